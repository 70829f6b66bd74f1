import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.errors import BsaError
from bsa.core.run.journal import Journal, read_events
from bsa.core.target import CellChange, target_named
from bsa.core.task import CellModel, ParameterFile
from bsa.experiments.api.discovery_result import DiscoveryResult
from bsa.experiments.api.scripts import namespace_of
from bsa.experiments.discover import discover
from bsa.experiments.discovery_bench.hidden_cell import Hidden, measure
from bsa.experiments.discovery_bench.hidden_physics import EFFECTS
from bsa.experiments.discovery_bench.protocols import Step
from bsa.experiments.discovery_bench.simulated_case import _write
from bsa.experiments.discovery_case import (
    DiscoverOptions,
    discover_options,
    read_case,
    reading_of_references,
    spreads_of,
)
from bsa.experiments.discovery_journal import opened, read_options
from bsa.experiments.discovery_setup import set_up
from bsa.experiments.file_reading import FileReading
from bsa.experiments.run import read_request
from bsa.experiments.run_record import read_run
from bsa.experiments.task_request import Records
from bsa.experiments.tasks.measured_cell import CellRequest
from bsa.experiments.tasks.parameter_source import FoundCell
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import build_task
from bsa.plugins.pybamm.cells.parameter_sets import pybamm
from bsa.plugins.pybamm.export.augmented_script import augmented_script
from bsa.plugins.pybamm.export.calibrated_script import parameter_values_json


def test_an_unknown_effect_is_an_error_with_a_hint():
    with pytest.raises(BsaError, match="self-heting"):
        effects_of(["self-heting"])


def test_options_refuse_what_they_do_not_know():
    with pytest.raises(ValueError, match="Extra"):
        DiscoverOptions.model_validate({"data": ["a.csv"], "parameters": "Chen2020", "out": "x", "dta": []})


@pytest.mark.slow
def test_what_is_uncertain_comes_from_a_preset_a_file_or_names(tmp_path):
    cell = CellModel("Chen2020", "SPMe")
    assert len(spreads_of("all", cell)) == 9
    assert len(spreads_of("capacity", cell)) == 3
    assert [name for name in spreads_of("all", CellModel("Chen2020", "SPM")) if "Electrolyte" in name] == []
    halved = {name: (spread / 2, lower, upper) for name, (spread, lower, upper) in spreads_of("all", cell).items()}
    assert spreads_of("measured", cell) == halved
    file = tmp_path / "search.yaml"
    file.write_text(
        "factors:\n  Cyclable lithium factor:\n  Separator porosity factor: {spread: 0.1, lower: 0.5, upper: 2}"
    )
    assert spreads_of(str(file), cell) == {
        "Cyclable lithium factor": (0.08, 0.7, 1.3),
        "Separator porosity factor": (0.1, 0.5, 2.0),
    }
    with pytest.raises(BsaError, match='"Separator porosity factor" has no influence in the model SPM'):
        spreads_of(str(file), CellModel("Chen2020", "SPM"))
    with pytest.raises(BsaError, match="capcity") as caught:
        spreads_of("capcity", cell)
    assert "capacity" in caught.value.hint
    unnamed = tmp_path / "search"
    unnamed.write_bytes(file.read_bytes())
    with pytest.raises(BsaError, match="there is no preset or file"):
        spreads_of(str(unnamed), cell)
    file.write_text("factors:\n  Separator porosty factor: {spread: 0.1, lower: 0.5, upper: 2}")
    with pytest.raises(BsaError, match="porosty"):
        spreads_of(str(file), cell)


def test_records_keep_the_names_of_their_files_and_those_of_one_name_are_told_apart(tmp_path):
    files = []
    for place in ("a/cell.csv", "b/cell.csv", "a/other.csv"):
        file = tmp_path / place
        file.parent.mkdir(exist_ok=True)
        files.append(half_discharge(file, 100.0 * len(files)))
    asked = {"data": files[:2], "holdout": files[2:], "parameters": "Chen2020", "model": "SPM", "scale": False}
    case = read_case(DiscoverOptions(**asked, out=tmp_path / "out"))
    names = [record.name for record in (*case.measured_records, *case.held)]
    assert names == ["cell (record 1)", "cell (record 2)", "other"]
    assert set(case.initial_soc) == set(names)


def test_a_record_starts_at_the_state_of_charge_that_was_said_of_it(tmp_path):
    files = [half_discharge(tmp_path / f"{name}.csv", 0.0) for name in ("a", "b", "held")]

    def begun(*socs):
        records = Records(files[:2], files[2:], initial_soc=socs)
        asked = discover_options(records, tmp_path / "out", parameters="Chen2020", model="SPM", scale=False)
        return read_case(asked).initial_soc

    told = begun()
    assert begun(0.7, 0.8) == {"a": 0.7, "b": 0.8, "held": told["held"]}
    assert begun(0.7) == {"a": 0.7, "b": 0.7, "held": told["held"]}
    with pytest.raises(BsaError, match="3 initial states of charge were given for 2 records"):
        begun(0.7, 0.8, 0.9)
    with pytest.raises(BsaError, match=r"an initial state of charge is 90"):
        begun(90.0)


def test_a_base_model_from_a_run_has_its_contact_resistance_and_its_temperature(tmp_path, monkeypatch):
    """It had neither, so that a discovery named the resistance that the run had found."""
    file = ParameterFile("run", "parameter-values", parameter_values_json(CellModel("Chen2020", "SPM"), CellChange()))
    run = FoundCell(file, {"contact resistance": "true", "thermal": "lumped"}, (), {}, 7e-3)
    monkeypatch.setattr("bsa.experiments.tasks.parameter_source.found_cell", lambda given: run)
    asked = {"data": [half_discharge(tmp_path / "cell.csv", 0.0)], "parameters": "run", "model": "SPM", "scale": False}
    case = read_case(DiscoverOptions(**asked, out=tmp_path / "out"))
    assert case.cell.options == {"contact resistance": "true", "thermal": "lumped"}
    assert "thermal=lumped" in case.notes[0]
    assert "The run left 7 mV of its own records" in case.notes[1]
    assert case.known_v == 7e-3
    cool = read_case(DiscoverOptions(**asked, options={"thermal": "isothermal"}, out=tmp_path / "out"))
    assert cool.cell.options["thermal"] == "isothermal"


def test_what_a_run_has_fitted_is_half_as_uncertain(tmp_path, run_toy):
    run_toy(tmp_path / "run", simulations=2)
    records = Records([half_discharge(tmp_path / "cell.csv", 0.0)])

    def searched(parameters, **others):
        return discover_options(records, tmp_path / "out", parameters=parameters, **others).search

    assert searched(str(tmp_path / "run")) == searched(str(tmp_path / "run"), search=None) == "measured"
    assert searched("Chen2020") == "all"
    assert searched(str(tmp_path / "run"), search="capacity") == "capacity"


def test_each_record_has_its_reference_or_none_has(tmp_path):
    files = [half_discharge(tmp_path / f"{name}.csv", 0.0) for name in ("a", "held", "a_before", "held_before")]
    asked = {"data": files[:1], "holdout": files[1:2], "parameters": "Chen2020", "model": "SPM", "scale": False}
    case = read_case(DiscoverOptions(**asked, reference=files[2:], out=tmp_path / "out"))
    assert [one.name for one in case.references] == ["a_before", "held_before"]
    with pytest.raises(BsaError, match="1 references were given for 2 records"):
        read_case(DiscoverOptions(**asked, reference=files[2:3], out=tmp_path / "out"))
    records = Records(files[:1], files[1:2])
    told = discover_options(records, tmp_path / "out", parameters="Chen2020", reference=files[2:])
    assert told.search == "unchanged"
    assert [file.path for file in told.reference] == files[2:]
    with pytest.raises(BsaError, match="read differently"):
        reading_of_references([FileReading(), FileReading()])


def test_a_contact_resistance_of_the_set_that_the_model_does_not_use_is_taken_out(tmp_path):
    """An effect adds to what the base model has, and begins at the base model."""
    files = [half_discharge(tmp_path / "cell.csv", 0.0)]
    cell = CellModel("Chen2020", "SPM", overrides={"Contact resistance [Ohm]": 0.02})
    path = tmp_path / "set.json"
    path.write_text(parameter_values_json(cell, CellChange()))
    asked = {"data": files, "parameters": str(path), "model": "SPM", "scale": False, "out": tmp_path / "out"}
    assert read_case(DiscoverOptions(**asked)).cell.overrides["Contact resistance [Ohm]"] == 0.0
    used = read_case(DiscoverOptions(**asked, options={"contact resistance": "true"}))
    assert "Contact resistance [Ohm]" not in used.cell.overrides


def test_a_voltage_that_is_written_late_is_kept_so_unless_a_lag_is_given(tmp_path):
    """It was taken back from the records with a varying current alone; the others kept the hidden lag."""
    time = np.arange(1500.0)
    current = np.repeat(np.random.default_rng(3).normal(-1.0, 3.0, 500), 3)
    late = 3.7 + 0.02 * np.interp(time - 2.0, time, current)
    rows = zip(time, current, late, strict=True)
    path = tmp_path / "drive.csv"
    path.write_text("\n".join(["Test Time / s,Current / A,Voltage / V", *(f"{t},{i},{v}" for t, i, v in rows)]))

    def voltage(**read):
        file = {"path": path, "read": read}
        asked = DiscoverOptions(data=[file], parameters="Chen2020", model="SPM", scale=False, out=tmp_path / "out")
        case = read_case(asked)
        return case.measured_records[0].record.voltage, [note for note in case.notes if "late" in note]

    kept, notes = voltage()
    assert kept == pytest.approx(late)
    assert notes == []
    assert voltage(voltage_lag_s=2.0)[0][100:200] == pytest.approx(late[102:202])


def test_a_current_keeps_its_offset_which_is_an_effect(tmp_path):
    """A fit takes off what a record does not bring back."""
    hours = np.arange(0.0, 44.0, 0.1)
    true = np.select([(hours >= 1) & (hours < 21), (hours >= 22) & (hours < 42)], [-0.25, 0.25], 0.0)
    written = np.where(true == 0.0, 0.0, true - 0.02)
    rows = zip(3600.0 * hours, written, 4.15 + 0.012 * np.cumsum(true), strict=True)
    path = tmp_path / "slow.csv"
    path.write_text("\n".join(["Test Time / s,Current / A,Voltage / V", *(f"{t},{i},{v}" for t, i, v in rows)]))
    options = DiscoverOptions(data=[{"path": path}], parameters="Chen2020", model="SPM", out=tmp_path / "out")
    (measured,) = read_case(options).measured_records
    assert measured.record.current == pytest.approx(-written)
    task = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(path)])
    assert task.experiments[0].target.discharge_capacity[-1] == pytest.approx(0.0, abs=1e-2)


def test_what_was_assumed_of_the_records_is_told_before_anything_is_simulated(tmp_path, monkeypatch):
    def stopped(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("bsa.experiments.discover.discover_on", stopped)
    asked = {"data": [half_discharge(tmp_path / "cell.csv", 0.0)], "parameters": "Chen2020", "model": "SPM"}
    heard = []
    with pytest.raises(KeyboardInterrupt):
        discover(DiscoverOptions(**asked, out=tmp_path / "out"), heard.append)
    assert any(text.startswith("note: cell.csv: begins under load (3.900 V") for text in heard)


@pytest.mark.slow
def test_a_discovered_cell_has_the_nominal_capacity_of_its_size(tmp_path):
    time = np.arange(0.0, 4201.0, 30.0)
    amperes = np.where(time < 600.0, 0.0, 10.0)
    volts = np.where(time < 600.0, 4.2, 3.95 - 1.4 * (time - 600.0) / 3600.0)
    rows = [f"{t},{v},{-a}" for t, v, a in zip(time, volts, amperes, strict=True)]
    (tmp_path / "big.csv").write_text("Test Time / s,Voltage / V,Current / A\n" + "\n".join(rows))
    options = {"data": [tmp_path / "big.csv"], "parameters": "Chen2020", "model": "SPM", "out": tmp_path / "out"}
    case = read_case(DiscoverOptions(**options))
    assert case.cell.overrides["Nominal cell capacity [A.h]"] == pytest.approx(10.0, rel=0.05)
    (record,) = case.measured_records
    start = {record.soc_name: 0.9}
    text = augmented_script(case.cell, (), start, {name: target_named(name) for name in start}, [record])
    script = namespace_of(text, "augmented_model")
    assert isinstance(script["parameter_values"]()["Current function [A]"], pybamm.Interpolant)
    values = DiscoveryResult(tmp_path, SimpleNamespace(script=text)).parameter_values
    assert values["Current function [A]"] == values["Nominal cell capacity [A.h]"]
    simulation = pybamm.Simulation(script["augmented_model"](), parameter_values=values, C_rate=1)
    solution = simulation.solve([0.0, 4000.0])
    assert solution["Current [A]"].entries[0] == pytest.approx(10.0, rel=0.05)
    assert solution.t[-1] == pytest.approx(0.9 * 3600.0, rel=0.1)  # empty at the set's own cut-off
    assert solution["Voltage [V]"].entries[-1] == pytest.approx(2.5, abs=0.01)
    drawn_ah = float(np.ptp(record.record.discharge_capacity))
    assert set_up(case, DiscoverOptions(**options)).capacity_ah == pytest.approx(drawn_ah, rel=0.005)
    person = read_case(DiscoverOptions(**options, overrides={"Electrode width [m]": 2 * 1.58}))
    assert person.cell.overrides["Nominal cell capacity [A.h]"] == pytest.approx(10.0)


def half_discharge(path, start_s):
    time = start_s + np.arange(0.0, 1200.0, 30.0)
    rows = [f"{t - start_s},{3.9 - 1e-4 * t},{-2.0}" for t in time]
    path.write_text("Test Time / s,Voltage / V,Current / A\n" + "\n".join(rows))
    return path


def test_files_of_one_cell_are_one_record_and_parameters_come_from_a_file(tmp_path):
    first, second = (half_discharge(tmp_path / name, start) for name, start in (("a.csv", 0.0), ("b.csv", 1200.0)))
    file = tmp_path / "set.json"
    file.write_text(parameter_values_json(CellModel("Chen2020", "SPM"), CellChange()))
    asked = {
        "data": [{"path": first, "joined": [second], "read": {"join": True}}],
        "parameters": str(file),
        "model": "SPM",
        "scale": False,
    }
    case = read_case(DiscoverOptions(**asked, out=tmp_path / "out"))
    (record,) = case.measured_records
    assert record.record.duration == pytest.approx(2370.0, abs=31.0)
    assert isinstance(case.cell.parameter_set, ParameterFile)
    with opened(DiscoverOptions(**asked, out=tmp_path / "out")) as journal:
        kept = next(read_events(tmp_path / "out"))
        journal.file.append("end", status="")
    assert {Path(name).name for name in kept["records"]} == {"a.csv", "b.csv", "set.json"}
    file.write_text("{}")
    with (
        pytest.raises(BsaError, match="is not what it was when"),
        opened(DiscoverOptions(**asked, out=tmp_path / "out")),
    ):
        pass


def test_a_folder_of_a_calibration_gets_no_advice_that_fails(tmp_path, run_toy):
    run_toy(tmp_path / "run", simulations=2)
    data = half_discharge(tmp_path / "a.csv", 0.0)
    options = DiscoverOptions(data=[data], parameters="Chen2020", out=tmp_path / "run")
    before = (tmp_path / "run" / "journal.jsonl").read_bytes()
    with pytest.raises(BsaError, match="belongs to a calibration") as refused, opened(options):
        pass
    assert refused.value.hint == "choose another --out folder."
    assert (tmp_path / "run" / "journal.jsonl").read_bytes() == before


def test_a_journal_from_before_an_option_was_there_is_resumed(tmp_path):
    options = DiscoverOptions(
        data=[half_discharge(tmp_path / "a.csv", 0.0)], parameters="Chen2020", out=tmp_path / "out"
    )
    with opened(options) as journal:
        journal.file.append("end", status="")
    file = tmp_path / "out" / "journal.jsonl"
    content = file.read_text()
    assert '"life":false,' in content
    file.write_text(content.replace('"life":false,', ""))
    with opened(read_options(tmp_path / "out")) as journal:
        assert len(journal.earlier) == 2


def test_a_resumed_discovery_names_the_file_that_has_changed(tmp_path):
    files = [half_discharge(tmp_path / name, 0.0) for name in ("a.csv", "b.csv")]
    options = DiscoverOptions(data=files, parameters="Chen2020", out=tmp_path / "out")
    with opened(options) as journal:
        journal.file.append("end", status="")
    with pytest.raises(BsaError, match="other options") as refused, opened(options.model_copy(update={"model": "SPM"})):
        pass
    assert "bsa discover --resume" in refused.value.hint
    (tmp_path / "b.csv").write_text((tmp_path / "b.csv").read_text() + "\n")
    with (
        pytest.raises(BsaError, match="is not what it was when") as refused,
        opened(read_options(tmp_path / "out")),
    ):
        pass
    assert "b.csv" in refused.value.message
    assert "a.csv" not in refused.value.message
    assert "--resume" not in refused.value.hint


@pytest.mark.slow
def test_a_hidden_resistance_is_found_from_files(tmp_path):
    (resistance,) = (effect for effect in EFFECTS if effect.key == "contact-resistance")
    shifts = {"Positive particle diffusivity [m2.s-1]": 1.3, "Negative particle radius [m]": 1.1}
    hidden = Hidden("Chen2020", "SPM", (resistance,), {resistance.strength: 0.02}, shifts)
    rng = np.random.default_rng(8)
    steps = [Step(0.0, 200.0), Step(1.0, 1500.0), Step(0.0, 900.0), Step(2.0, 60.0, period=2.0), Step(0.0, 300.0)]
    steps += [Step(0.3, 1500.0), Step(0.0, 600.0)]
    for file, soc in (("a.csv", 0.9), ("held.csv", 0.8)):
        _write(tmp_path / file, measure(hidden, steps, soc, 298.15, rng)[0])
    options = DiscoverOptions(
        data=[tmp_path / "a.csv"],
        holdout=[tmp_path / "held.csv"],
        parameters="Chen2020",
        model="SPM",
        ambient_c=25.0,
        scale=False,
        effects=["contact-resistance", "voltage-offset"],
        points=200,
        out=tmp_path / "out",
    )
    found = discover(options, workers=2)
    assert found.verdict == "effect-found", found.findings.reason
    assert found.names == ("contact-resistance",)
    assert found.gap["closed"] > 0.95
    content = json.loads((tmp_path / "out" / "discovery.json").read_text())
    assert {
        "verdict",
        "effects",
        "localisation",
        "candidates",
        "gap",
        "next_experiment",
        "simulations",
        "wall_s",
    } <= set(content)
    (effect,) = content["effects"]
    assert effect["parameters"][0]["value"] == pytest.approx(0.02, rel=0.25)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "content=\"default-src 'none'; style-src 'unsafe-inline'\"" in page
    assert "contact-resistance" in page
    assert page.count('<svg class="chart"') == 2
    assert "<h3>held, held out</h3>" in page
    assert "<script" not in page
    script = [sys.executable, tmp_path / "out" / "augmented_model.py"]
    said = subprocess.run(script, capture_output=True, text=True, timeout=300, check=True).stdout
    rms_mv = float(said.split("rms error ")[1].split(" mV")[0])
    assert rms_mv == pytest.approx(found.gap["final_rmse_mv"], abs=0.1)  # the script tells tenths
    simulated = count_simulations(options.out)
    again = discover(read_options(options.out))
    assert (again.verdict, again.gap) == (found.verdict, found.gap)
    assert count_simulations(options.out) == simulated
    with pytest.raises(BsaError, match="other options"):
        discover(options.model_copy(update={"max_effects": 1}))
    (tmp_path / "a.csv").write_text((tmp_path / "held.csv").read_text())
    with pytest.raises(BsaError, match="is not what it was when"):
        discover(options)


def count_simulations(folder):
    return sum(event["event"] == "simulation" for event in read_events(folder))


def test_the_folder_of_a_calibration_is_not_resumed_as_a_discovery_nor_the_reverse(tmp_path, run_toy):
    run_toy(tmp_path / "run")
    with pytest.raises(BsaError, match="not the journal of a discovery") as caught:
        read_options(tmp_path / "run")
    assert "bsa run --resume" in caught.value.hint
    journal = Journal(tmp_path / "discovery")
    journal.append("run", format=1, kind="discovery", options={}, records={})
    journal.close()
    with pytest.raises(BsaError, match="discovery") as caught:
        read_request(tmp_path / "discovery")
    assert "bsa discover --resume" in caught.value.hint
    with pytest.raises(BsaError, match="discovery") as caught:
        read_run(tmp_path / "discovery")
    assert "augmented_model.py" in caught.value.hint
    assert "bsa run --data FILE --parameters NAME --effect EFFECT" in caught.value.hint
