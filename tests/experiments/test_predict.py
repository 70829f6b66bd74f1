"""Records that a run did not fit: `--holdout`, `bsa predict` and `CalibrationResult.predict` on one small cell."""

import json
from dataclasses import replace

import bsa
import numpy as np
import pandas
import pytest
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.experiments.cli.main import app
from bsa.experiments.read_options import reading
from bsa.experiments.run_record import read_run
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.modelling.resolution import REFERENCE
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference
from typer.testing import CliRunner

RADIUS = "Positive particle radius [m]"
TRUE = {"values": {RADIUS: 9e-6}}


def measured(c_rate: float, minutes: int, start: float = 0.0) -> pandas.DataFrame:
    """A rest of a minute and a discharge from 90 %, as a cycler writes it; the first ``start`` seconds left out."""
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    protocol = (("Rest for 60 seconds", f"Discharge at {c_rate}C for {minutes} minutes"),)
    experiment = Experiment("x", nothing, protocol, initial_soc=0.9)
    # As in a real cell, diffusion is resolved.
    run = solve_reference(CellModel("Chen2020", "SPM"), experiment, CellChange(**TRUE), REFERENCE.graded())
    assert run.trajectory is not None
    kept = run.trajectory.time > start
    return pandas.DataFrame(
        {
            "Time [s]": run.trajectory.time[kept],
            "Current [A]": -run.trajectory.current[kept],
            "Voltage [V]": run.trajectory.voltage[kept],
        }
    ).drop_duplicates("Time [s]")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    return bsa.calibrate(
        measured(1.0, 20),
        holdout=bsa.read_record(measured(2.0, 10), name="twice"),
        parameters="Chen2020",
        model="SPM",
        options={"contact resistance": "false"},
        search={RADIUS: {"factors": [0.5, 3.0]}},
        scaffold="least-squares",
        warmup=0,
        simulations=8,
        workers=1,
        out=folder,
        progress=False,
    )


def test_held_out_records_are_in_the_result_and_in_the_report(fitted) -> None:
    rows = {row["record"]: row for row in fitted.to_json()["records"]}
    assert [row["fitted"] for row in rows.values()] == [True, False]
    held = rows["twice"]
    assert held["signals"]["voltage"]["unit"] == "mV"
    assert held["signals"]["voltage"]["rms"] < 2.0
    assert held["bands"]["voltage"]["rms"] > 0
    assert fitted.record_errors["twice"]["voltage"]["rms"] == held["signals"]["voltage"]["rms"]
    assert {"objective", "v_rmse_mv", "v_mape"} < set(fitted.to_json()["best"])
    assert "mape" not in fitted.to_json()["best"]
    page = fitted.report.read_text()
    assert "Record by record, fitted and held out" in page
    assert "95 % band" in page
    assert "Total MAPE" not in page


@pytest.mark.slow
def test_a_later_record_is_scored_wherever_it_starts(fitted) -> None:
    at_rest = fitted.predict(bsa.read_record(measured(0.5, 20), name="half"), workers=1)
    assert at_rest.errors["half"]["voltage"]["rms"] < 2.0
    assert 0 < at_rest.bands["half"]["voltage"]["rms"] < 20.0
    assert at_rest.report.is_file()
    assert json.loads((at_rest.folder / "prediction.json").read_text()) == at_rest.to_json()
    assert "half" in at_rest._repr_html_()
    assert "half, held out: voltage" in repr(at_rest)
    loaded = fitted.predict(bsa.read_record(measured(0.5, 20, start=60.0), name="loaded"), workers=1)
    assert loaded.errors["loaded"]["voltage"]["rms"] < 20.0  # its first sample is half a minute late
    assert any("begins under load" in note for note in loaded.to_json()["notes"])


@pytest.mark.slow
def test_the_command_predicts_and_takes_a_state_of_charge(fitted, tmp_path) -> None:
    path = tmp_path / "half.csv"
    measured(0.5, 20).to_csv(path, index=False)
    arguments = ["predict", str(fitted.folder), "--data", str(path), "--out", str(tmp_path / "p"), "--workers", "1"]
    result = CliRunner().invoke(app(), [*arguments, "--initial-soc", "0.9"])
    assert result.exit_code == 0, result.output
    assert "half.csv, held out: voltage" in result.stdout
    rms = json.loads((tmp_path / "p" / "prediction.json").read_text())["records"][0]["signals"]["voltage"]["rms"]
    assert rms < 2.0


def test_a_prediction_is_neither_overwritten_nor_simulated_without_a_place(fitted, tmp_path, monkeypatch) -> None:
    (tmp_path / "discovery.json").write_text("{}")
    monkeypatch.setattr("bsa.experiments.predict.predict_records", lambda *arguments: pytest.fail("it was simulated"))
    (tmp_path / "half.csv").write_text("x")
    arguments = ["predict", str(fitted.folder), "--data", str(tmp_path / "half.csv"), "--out", str(tmp_path)]
    refused = CliRunner().invoke(app(), arguments)
    assert isinstance(refused.exception, BsaError)
    assert "is not empty; nothing was written" in refused.exception.message
    with pytest.raises(BsaError, match="is not empty"):
        fitted.predict(bsa.read_record(measured(0.5, 20), name="half"), out=tmp_path)


@pytest.mark.slow
def test_a_record_of_a_cell_of_another_size_is_asked_about(fitted, tmp_path) -> None:
    hours = np.linspace(0.0, 1.0, 120)
    record = {"Time [s]": 3600.0 * hours, "Current [A]": -1.0, "Voltage [V]": 4.15 - 1.6 * hours**4}
    path = tmp_path / "other.csv"
    pandas.DataFrame(record).to_csv(path, index=False)
    arguments = ["predict", str(fitted.folder), "--data", str(path), "--out", str(tmp_path / "p"), "--workers", "1"]
    result = CliRunner().invoke(app(), arguments)
    assert result.exit_code == 0, result.output
    words = "the record holds 1 A.h, the cell of the fit 5 A.h, nominally: is it a record of this cell?"
    assert f"note: other.csv (held out): {words}" in result.stderr
    of_size = fitted.predict(bsa.read_record(measured(0.5, 20), name="half"), workers=1)
    assert not any("holds" in note for note in of_size.notes)
    assert f"other.csv (held out): {words}" in json.loads((tmp_path / "p" / "prediction.json").read_text())["notes"]


@pytest.mark.slow
def test_a_spectrum_is_compared_with_the_fitted_cell(fitted, tmp_path) -> None:
    frequency = np.logspace(3, -2, 12)
    table = {"Frequency [Hz]": frequency, "Zreal [ohm]": 0.02 + 0.01 / (1 + frequency / 10), "Zimag [ohm]": -1e-3}
    path = tmp_path / "z.csv"
    pandas.DataFrame(table | {"Voltage [V]": 3.9}).to_csv(path, index=False)
    arguments = ["predict", str(fitted.folder), "--data", str(path), "--out", str(tmp_path / "p"), "--json"]
    result = CliRunner().invoke(app(), arguments)
    assert result.exit_code == 0, result.output
    (found,) = json.loads((tmp_path / "p" / "prediction.json").read_text())["records"]
    assert found["record"] == "z.csv"
    assert found["signals"]["resistance"]["unit"] == "mohm"
    assert found["bands"]["resistance"]["inside"] == 0.0
    assert found["impedance"]["ohmic_mohm"] == pytest.approx(20.1, abs=0.1)
    assert 0.0 < found["impedance"]["ohmic_simulated_mohm"] < 100.0
    page = (tmp_path / "p" / "prediction.html").read_text()
    assert "Re Z / mohm" in page
    assert "ohmic" in page.casefold()
    assert fitted.predict(path).spectra["z.csv"] == found["impedance"]


@pytest.mark.slow
def test_what_cannot_be_predicted_is_refused_in_a_line(fitted, tmp_path) -> None:
    half = bsa.read_record(measured(0.5, 20), name="half")
    with pytest.raises(BsaError, match="2 initial states of charge were given for 1 records"):
        fitted.predict(half, initial_soc=[0.5, 0.6])
    with pytest.raises(BsaError, match="is 90"):
        fitted.predict(half, initial_soc=90)
    with pytest.raises(BsaError, match='no option "colunm"'):
        fitted.predict(half, colunm={"voltage": "U"})
    with pytest.raises(BsaError, match=r"is fitted, so that .*\.record_errors of the result"):
        fitted.predict(bsa.read_record(measured(1.0, 20), name="DataFrame 1"))


def task_after(fitted, **settings):
    return task_of_records(Records([bsa.read_record(measured(0.5, 5), name="next")]), CellChoice(**settings))


def test_joined_files_are_one_record(tmp_path) -> None:
    whole = measured(0.5, 20)
    half = len(whole) // 2
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path, part in zip(paths, (whole[:half], whole[half:]), strict=True):
        part.to_csv(path, index=False)
    cell = CellChoice("Chen2020", "SPM")
    (joined,) = task_of_records(Records(paths, reads=[reading(join=True)]), cell).experiments
    assert joined.target.duration == pytest.approx(whole["Time [s]"].max(), rel=0.1)
    assert len(task_of_records(Records(paths), cell).experiments) == 2


@pytest.mark.slow
def test_a_run_starts_from_the_best_values_of_another(fitted) -> None:
    best = fitted.parameters[RADIUS]
    goes_on = task_after(fitted, start_from=fitted.folder)
    assert (goes_on.cell.parameter_set, goes_on.cell.model) == ("Chen2020", "SPM")
    assert goes_on.cell.options == {"contact resistance": "false"}
    (parameter,) = goes_on.space
    assert (parameter.name, parameter.initial, parameter.upper) == (RADIUS, best, pytest.approx(3 * 5.22e-6))
    other = task_after(fitted, start_from=fitted.folder, search={"Electrode width [m]": {"factors": [0.8, 1.25]}})
    assert str(other.cell.parameter_set) == "run (Chen2020 calibrated)"
    assert load(other.cell.parameter_set)[RADIUS] == best
    with pytest.raises(BsaError, match="give one of them"):
        task_after(fitted, start_from=fitted.folder, parameters="Chen2020")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["", "best_parameters.json"])
def test_a_run_s_folder_or_best_parameters_is_a_parameter_set(fitted, name) -> None:
    task = task_after(fitted, parameters=str(fitted.folder / name), search={RADIUS: {"factors": [0.5, 2.0]}})
    assert task.space[RADIUS].initial == fitted.parameters[RADIUS]
    assert decode_task(json.loads(json.dumps(encode_task(task)))).cell == task.cell


def test_best_parameters_without_their_run_say_what_they_lack(fitted, tmp_path) -> None:
    alone = tmp_path / "best_parameters.json"
    alone.write_text((fitted.folder / "best_parameters.json").read_text())
    with pytest.raises(BsaError, match="no whole parameter set"):
        task_after(fitted, parameters=str(alone))


@pytest.mark.slow
def test_a_run_that_was_not_analysed_says_how_a_band_comes(fitted, tmp_path) -> None:
    folder = tmp_path / "bare run"
    folder.mkdir()
    lines = (fitted.folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith(b'{"event":"appraisal"')]
    (folder / "journal.jsonl").write_bytes(b"".join(kept))
    path = tmp_path / "half.csv"
    measured(0.5, 20).to_csv(path, index=False)
    arguments = ["predict", str(folder), "--data", str(path), "--out", str(tmp_path / "p"), "--workers", "1"]
    result = CliRunner().invoke(app(), arguments)
    assert result.exit_code == 0, result.output
    assert f"to find out: bsa-run --resume '{folder}'" in result.stderr


@pytest.mark.slow
def test_notes_of_records_that_the_run_held_out_are_not_told_of_another(fitted, monkeypatch) -> None:
    run = read_run(fitted.folder)
    of_fitted = "a copy (held out): repaired"  # whose name only looks like it
    noted = replace(run, task=replace(run.task, notes=(of_fitted, "twice (held out): begins under load")))
    monkeypatch.setattr("bsa.experiments.predict.read_run", lambda folder: noted)
    loaded = fitted.predict(bsa.read_record(measured(0.5, 20, start=60.0), name="loaded"), workers=1)
    notes = loaded.to_json()["notes"]
    assert any("loaded (held out)" in note for note in notes)
    assert not any("twice (held out)" in note or note == of_fitted for note in notes)
    assert of_fitted in loaded._scored.run.task.notes
