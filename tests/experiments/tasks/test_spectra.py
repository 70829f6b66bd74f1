"""Spectra that are fitted: known parameters of an independent simulation come back, alone and beside the voltage."""

import json
import sys

import bsa
import numpy as np
import pandas
import pybamm
import pytest
from bsa.core.comparison.residuals import rows_of
from bsa.core.errors import BsaError
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.experiments.cli.main import app, main
from bsa.experiments.run_record import read_run
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.plugins.proposers.stage_data import view_of
from bsa.plugins.pybamm.cells.state_of_charge import InitialState
from bsa.plugins.pybamm.modelling.resolution import REFERENCE
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference
from typer.testing import CliRunner

CONTACT = "Contact resistance [Ohm]"
EXCHANGE = "Negative electrode exchange-current density [A.m-2] factor"
CAPACITIES = [f"{which} electrode double-layer capacity [F.m-2]" for which in ("Negative", "Positive")]
OHM, FACTOR = 0.012, 0.5


def spectrum(path, soc: float, leads: float = 1e-7, voltage: bool = True):
    """What PyBaMM alone has for the known cell, with the inductance of leads, as a table of frequency and impedance."""
    values = pybamm.ParameterValues("Chen2020")
    volts, state = np.linspace(3.0, 4.2, 121), InitialState(values)
    rest_v = float(np.interp(soc, [state.soc_at(v) for v in volts], volts))
    own = values["Negative electrode exchange-current density [A.m-2]"]
    values.update({CONTACT: OHM}, check_already_exists=False)
    values["Negative electrode exchange-current density [A.m-2]"] = lambda *a: FACTOR * own(*a)
    model = pybamm.lithium_ion.SPMe({"surface form": "differential", "contact resistance": "true"})
    frequency = np.logspace(4, -2, 37)
    # As in a real cell, diffusion is resolved.
    points = {**model.default_var_pts, "r_n": 200, "r_p": 200}
    simulation = pybamm.EISSimulation(model, parameter_values=values, var_pts=points)
    solution = simulation.solve(frequency, initial_soc=f"{rest_v} V")
    z = solution["Impedance [Ohm]"] + 2j * np.pi * frequency * leads
    columns = {"Frequency [Hz]": frequency, "Zreal [ohm]": z.real, "Zimag [ohm]": z.imag}
    pandas.DataFrame(columns | ({"Voltage [V]": rest_v} if voltage else {})).to_csv(path, index=False)
    return path


def discharge(path):
    """A rest of a minute and twenty minutes of discharge, as a cycler writes it."""
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    protocol = (("Rest for 60 seconds", "Discharge at 1C for 20 minutes"),)
    curve = solve_reference(
        CellModel("Chen2020", "SPMe", {"contact resistance": "true"}, {CONTACT: OHM}),
        Experiment("x", nothing, protocol, initial_soc=0.9),
        CellChange(factors={EXCHANGE.removesuffix(" factor"): FACTOR}),
        REFERENCE.graded(),
    ).trajectory
    assert curve is not None
    table = {"Time [s]": curve.time, "Current [A]": -curve.current, "Voltage [V]": curve.voltage}
    pandas.DataFrame(table).drop_duplicates("Time [s]").to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spectra")
    return {
        "half": spectrum(folder / "half.csv", 0.5),
        "low": spectrum(folder / "low.csv", 0.2),
        "unknown": spectrum(folder / "unknown.csv", 0.5, voltage=False),
        "discharge": discharge(folder / "discharge.csv"),
    }


SETTINGS = {
    "parameters": "Chen2020",
    "model": "SPMe",
    "search": {CONTACT: [0.0, 0.05], EXCHANGE: {"factors": [0.1, 10.0]}},
    "warmup": 0,
    "workers": 1,
    "progress": False,
}


@pytest.fixture(scope="module")
def fitted(files, tmp_path_factory):
    return bsa.calibrate(
        files["half"],
        holdout=files["low"],
        scaffold="least-squares",
        simulations=25,
        out=tmp_path_factory.mktemp("runs") / "run",
        **SETTINGS,
    )


@pytest.mark.slow
def test_known_parameters_come_back_from_a_spectrum(fitted) -> None:
    assert fitted.parameters[CONTACT] == pytest.approx(OHM, rel=0.02)
    assert fitted.parameters[EXCHANGE] == pytest.approx(FACTOR, rel=0.02)
    content = json.loads((fitted.folder / "result.json").read_text())
    assert {interval["verdict"] for interval in content["identifiability"]["intervals"].values()} == {"fixed"}
    own, held_out = content["records"]
    assert (own["record"], held_out["record"]) == ("half.csv", "low.csv")
    for record in (own, held_out):
        assert set(record["signals"]) == {"resistance", "reactance"}
        assert record["signals"]["resistance"]["unit"] == "mohm"
        assert record["signals"]["resistance"]["rms"] < 0.3
        assert record["impedance"]["ohmic_simulated_mohm"] == pytest.approx(record["impedance"]["ohmic_mohm"], abs=0.3)
    assert held_out["bands"]["resistance"]["inside"] >= 0.0
    assert any("are inductive and left out" in note for note in read_run(fitted.folder).task.notes)


@pytest.mark.slow
def test_reports_draw_spectra_and_tell_errors_in_milliohm(fitted) -> None:
    page = (fitted.folder / "report.html").read_text()
    assert page.count("Re Z / mohm") == 2
    assert "mV" not in page.split("Record by record")[1].split("</table>")[0]
    row = next(line for line in repr(fitted).splitlines() if line) if repr(fitted) else ""
    assert "mV" not in row


@pytest.mark.slow
def test_a_run_that_stopped_goes_on(files, fitted, tmp_path) -> None:
    out = tmp_path / "run"
    settings = SETTINGS | {"scaffold": "least-squares", "simulations": 6, "identifiability": False, "out": out}
    first = bsa.calibrate(files["half"], holdout=files["low"], **settings)
    lines = (out / "journal.jsonl").read_text().splitlines()
    trials = [place for place, line in enumerate(lines) if json.loads(line)["event"] == "trial"]
    assert len(trials) == 6
    (out / "journal.jsonl").write_text("\n".join(lines[: trials[3]]) + "\n")
    again = bsa.calibrate(resume=out, identifiability=False, progress=False)
    assert again.parameters == first.parameters
    records = again.to_json()["records"]
    assert [record["signals"]["reactance"]["unit"] for record in records] == ["mohm", "mohm"]
    assert read_run(out).task.experiments[0].is_spectrum


@pytest.mark.slow
def test_the_exported_script_has_the_spectrum(fitted, capsys) -> None:
    source = (fitted.folder / "best_parameters.py").read_text()
    space: dict = {"__name__": "exported"}
    exec(compile(source, "best_parameters.py", "exec"), space)
    frequency, real, imaginary = space["impedance"](0).T
    best = read_run(fitted.folder).final_curves if hasattr(read_run(fitted.folder), "final_curves") else None
    assert best is None or real == pytest.approx(best[0].values("resistance"), rel=1e-3)
    assert frequency[0] > frequency[-1]
    assert np.all(real > OHM)
    assert imaginary[1] < 0


def task_of(*data, held_out=(), search="cell", **cell):
    return task_of_records(Records(list(data), list(held_out)), CellChoice("Chen2020", "SPMe", search=search, **cell))


@pytest.mark.slow
def test_a_spectrum_beside_the_voltage_brings_the_double_layers_into_the_search(files) -> None:
    alone = task_of(files["discharge"], held_out=[files["half"]])
    both = task_of(files["discharge"], files["half"])
    assert not set(CAPACITIES) & set(alone.space.names)
    assert set(CAPACITIES) <= set(both.space.names)
    assert "surface form" not in both.cell.options
    assert [signal.name for signal in alone.signals] == ["current", "voltage"]
    assert [signal.name for signal in both.observed] == ["voltage", "resistance", "reactance"]
    assert [experiment.is_spectrum for experiment in both.experiments] == [False, True]
    # The spectrum is at its own voltage, whatever is searched of the other record.
    searched = [name for name in both.space.names if name.startswith("Initial state of charge")]
    assert searched == ["Initial state of charge: discharge.csv"]
    assert both.experiments[1].initial_soc is None
    # Of the spectrum the kinetics see what lies above 1 Hz, each decade of a part as one current step.
    rows, view = rows_of(both), view_of(both, "current-steps")
    seen = view.rows[np.isin(rows.signal[view.rows], ("resistance", "reactance"))]
    highest = both.experiments[1].target.values("frequency")[0]
    assert np.all(highest / 10 ** rows.since_s[seen] >= 1.0)
    ones = np.ones(len(rows.signal)) * rows.scale
    squares = view(ones)[np.isin(rows.signal[view.rows], ("resistance", "reactance"))] ** 2
    assert np.sum(squares) == pytest.approx(2 * np.log10(highest), rel=0.1)
    assert set(rows.signal[view_of(both, "open-circuit").rows]) <= {"voltage"}
    assert set(rows.signal[view_of(both, "everything").rows]) == {"voltage", "resistance", "reactance"}


@pytest.mark.slow
def test_a_staged_fit_of_both_finds_the_known_cell(files, tmp_path) -> None:
    found = bsa.calibrate(
        [files["discharge"], files["half"]], scaffold="staged", simulations=30, out=tmp_path / "run", **SETTINGS
    )
    assert found.parameters[CONTACT] == pytest.approx(OHM, rel=0.05)
    assert found.parameters[EXCHANGE] == pytest.approx(FACTOR, rel=0.1)
    errors = {record["record"]: record["signals"] for record in found.to_json()["records"]}
    assert errors["discharge.csv"]["voltage"]["unit"] == "mV"
    assert errors["half.csv"]["reactance"]["unit"] == "mohm"


@pytest.mark.slow
def test_a_state_of_charge_must_be_known(files, tmp_path, monkeypatch, capsys) -> None:
    with pytest.raises(BsaError, match=r"unknown\.csv has no voltage"):
        task_of(files["unknown"])
    arguments = [
        "bsa",
        "run",
        "--data",
        str(files["unknown"]),
        "--parameters",
        "Chen2020",
        "--out",
        str(tmp_path / "no"),
    ]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "give --initial-soc" in capsys.readouterr().err
    given = task_of_records(
        Records([files["unknown"]], initial_soc=[0.5]), CellChoice("Chen2020", "SPMe", search=SETTINGS["search"])
    )
    assert given.experiments[0].initial_soc == 0.5


def test_a_spectrum_is_no_life(files) -> None:
    with pytest.raises(BsaError, match=r"half\.csv is an impedance spectrum: it is no life"):
        task_of_records(Records([files["half"]], life=True), CellChoice("Chen2020", "SPMe"))


def test_a_task_file_lists_spectra(files, tmp_path) -> None:
    lines = ["name: cell", "parameter_set: Chen2020", "model: SPMe", "search: cell", "experiments:"]
    lines += [f"  - {{data: {files['discharge']}}}", f"  - {{data: {files['unknown']}, initial_soc: 0.5}}"]
    lines += [f"held_out: [{{data: {files['low']}}}]"]
    path = tmp_path / "task.yaml"
    path.write_text("\n".join(lines))
    from bsa.experiments.tasks.task_file import load_task_file

    task = load_task_file(path)
    assert [one.is_spectrum for one in (*task.experiments, *task.held_out)] == [False, True, True]
    assert task.experiments[1].initial_soc == 0.5


@pytest.mark.parametrize(("factor", "meant"), [(1.0, ""), (1e3, "mohm"), (1e-3, "ohm")])
def test_an_impedance_that_the_cell_cannot_have_is_asked_for_its_unit(files, tmp_path, factor, meant) -> None:
    table = pandas.read_csv(files["half"])
    table[["Zreal [ohm]", "Zimag [ohm]"]] *= factor
    table.to_csv(tmp_path / "z.csv", index=False)
    for sources, held in (([tmp_path / "z.csv"], []), ([files["discharge"]], [tmp_path / "z.csv"])):
        notes = task_of_records(Records(sources, held), CellChoice("Chen2020", "SPMe", search=SETTINGS["search"])).notes
        asked = [note for note in notes if "Is it in" in note]
        assert len(asked) == bool(meant)
        assert all(note.endswith(f"Is it in {meant}? Then say --reader-option unit={meant}.") for note in asked)
    if meant == "mohm":
        assert " ohm or more: " in asked[0]
        assert " V at 1C of a cell of 5 A.h, which has 1.7 V between its cut-offs." in asked[0]


def test_a_discovery_refuses_spectra_in_a_line(files, tmp_path) -> None:
    arguments = ["discover", "--data", str(files["discharge"]), str(files["half"]), "--parameters", "Chen2020"]
    result = CliRunner().invoke(app(), [*arguments, "--out", str(tmp_path / "d")])
    assert isinstance(result.exception, BsaError)
    assert "half.csv is an impedance spectrum; a discovery compares records over time alone" in str(result.exception)
