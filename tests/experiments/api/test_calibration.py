"""`bsa.calibrate`: what `bsa run` does, from Python."""

import inspect
import json
import socket
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import bsa
import numpy as np
import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.errors import BsaError
from bsa.core.messages import Usage
from bsa.experiments.cli.run import run as command
from bsa.experiments.tasks.find import PACKAGED
from bsa_toy_cell import CAPACITY, HIDDEN, SERIES, toy_task

DEMO = PACKAGED / "demo.csv"
SMALL = {"scaffold": "full", "rounds": 6, "warmup": 4, "simulations": 12, "progress": False}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)


def calibrated(folder):
    return bsa.calibrate(toy_task(), settings={"simulator": "toy-cell"}, out=folder, **SMALL)


@pytest.fixture(scope="module")
def toy_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs") / "toy"


@pytest.fixture(scope="module")
def toy(toy_folder):
    return calibrated(toy_folder)


def test_options_and_their_defaults_are_those_of_the_command() -> None:
    def options(function, *without):
        found = inspect.signature(function).parameters.values()
        return {one.name: one.default for one in found if one.name not in without}

    # Files of one cell are joined by read_record, whose result is the data.
    said_otherwise = ("context", "task", "data", "join", "as_json", "version")
    assert options(bsa.calibrate, "data", "progress") == options(command, *said_otherwise)


def test_a_task_is_calibrated_and_its_result_told(toy, toy_folder) -> None:
    assert toy.folder == toy_folder
    assert toy.report.is_file()
    assert set(toy.parameters) == set(toy_task().space.names)
    assert toy.to_json() == json.loads((toy_folder / "result.json").read_text())
    assert toy.to_json()["best"]["parameters"] == toy.parameters
    assert toy.to_json()["status"] == toy.status
    lower, upper = toy.intervals[CAPACITY]
    # So short a search stops beside the interval; the truth lies in it.
    assert lower <= HIDDEN[CAPACITY] <= upper
    error = toy.errors["Voltage RMSE where both records exist [mV]"]
    assert error["best"] < error["initial"]
    misfit = toy.errors["RMS misfit in the search [tolerances]"]
    assert misfit["best"] < misfit["initial"]
    assert "toy" in repr(toy)
    assert len(repr(toy)) < 400


def test_a_notebook_shows_errors_parameters_intervals_curves_and_the_report(toy) -> None:
    page = toy._repr_html_()
    assert SERIES in page
    assert "95 % interval" in page
    assert "not computed" not in page
    assert 'src="data:image/svg+xml;base64,' in page
    assert toy.report.as_uri() in page
    assert "<script" not in page


@pytest.mark.slow
def test_a_name_from_a_file_is_no_markup_in_a_notebook(tmp_path) -> None:
    name = "<script>alert(1)</script>"
    hostile = bsa.calibrate(toy_task(name=name), settings={"simulator": "toy-cell"}, out=tmp_path / "x", **SMALL)
    assert name not in hostile._repr_html_()


def test_what_is_no_cell_of_pybamm_has_no_parameter_values(toy) -> None:
    with pytest.raises(BsaError, match="toy"):
        _ = toy.parameter_values


@pytest.mark.slow
def test_without_a_folder_runs_are_numbered_as_the_command_does() -> None:
    found = bsa.calibrate(toy_task(), settings={"simulator": "toy-cell"}, **SMALL)
    assert found.folder == Path("runs/toy-full-1")


@pytest.mark.slow
def test_an_interrupted_run_says_how_it_goes_on_and_does(tmp_path, monkeypatch, capsys) -> None:
    def stop(self, *arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("bsa.experiments.api.progress.CalibrationBar.proposed", stop)
        cut = bsa.calibrate(toy_task(), settings={"simulator": "toy-cell"}, out=tmp_path / "cut", **SMALL)
    assert cut.status == "interrupted"
    assert f"calibrate(resume={str(tmp_path / 'cut')!r})" in capsys.readouterr().err
    whole = bsa.calibrate(resume=tmp_path / "cut", progress=False)
    assert whole.status != "interrupted"
    assert whole.folder == cut.folder
    assert bsa.CalibrationResult.of(cut.folder).parameters == whole.parameters


@pytest.mark.parametrize(
    ("data", "options", "words"),
    [
        ("no-such-task", {}, 'no task "no-such-task"'),
        ("no_such_file.csv", {"parameters": "Chen2020"}, "no file no_such_file.csv"),
        (DEMO, {}, "needs a parameter set"),
        ("demo", {"parameters": "Chen2020"}, '"demo" is a task'),
        (3, {"parameters": "Chen2020"}, "int is no record"),
        (DEMO, {"parameters": "Chen2020", "search": "no-such"}, "no-such"),
        (DEMO, {"parameters": "Chen2020", "current_sign": "sideways"}, "current_sign"),
        ("demo", {"settings": {"patienc": 3}}, "patienc"),
        ("demo", {"settings": "patience=3"}, "give a mapping, {'patience': '3'}"),
        (DEMO, {"parameters": "Chen2020", "options": ["thermal=lumped"]}, "--options is"),
        (DEMO, {"parameters": "Chen2020", "effect": "contact-resistence"}, 'no effect "contact-resistence"'),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(data, options, words, tmp_path) -> None:
    with pytest.raises(BsaError, match=words):
        bsa.calibrate(data, progress=False, **options)
    assert list(tmp_path.iterdir()) == []


def test_a_record_that_is_read_takes_no_options_for_reading() -> None:
    record = bsa.read_record(DEMO)
    with pytest.raises(BsaError, match="temperature"):
        bsa.calibrate(record, parameters="Chen2020", temperature=20)


@pytest.mark.slow
def test_five_lines_without_a_main_guard_give_ready_parameter_values(tmp_path) -> None:
    script = tmp_path / "five.py"
    script.write_text(
        textwrap.dedent(f"""
            from bsa import calibrate, read_record
            record = read_record({str(DEMO)!r})
            found = calibrate(record, parameters="Chen2020", model="SPM", simulations=3, workers=2,
                              identifiability=False, out="found")
            values = found.parameter_values
            name = "Contact resistance [Ohm]"
            assert abs(values[name] / found.parameters[name] - 1) < 1e-12
            import pybamm
            simulation = pybamm.Simulation(found.model, parameter_values=values, C_rate=0.1)
            print(len(simulation.solve([0, 60])["Voltage [V]"].entries))
        """)
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 1
    assert "simulations" in done.stderr
    assert np.isfinite(json.loads((tmp_path / "found" / "result.json").read_text())["wall_s"])


@pytest.mark.slow
def test_a_run_goes_on_with_more_simulations_and_refuses_less(tmp_path) -> None:
    toy = calibrated(tmp_path / "toy")
    assert toy.to_json()["status"] == "rounds-spent"
    more = bsa.calibrate(resume=toy.folder, simulations=16, rounds=12, progress=False)
    assert more.to_json()["simulations"] == 16
    assert more.to_json()["identifiability"]["budget"] == 16
    with pytest.raises(BsaError, match="has made 16 simulations"):
        bsa.calibrate(resume=toy.folder, simulations=3, progress=False)


def test_a_spent_allowance_holds_when_the_run_goes_on(tmp_path, monkeypatch, capsys) -> None:
    plain = RulesBackend.complete
    monkeypatch.setattr(
        RulesBackend, "complete", lambda *given, **seed: replace(plain(*given, **seed), usage=Usage(50, 50, 0, 0.01))
    )
    folder = tmp_path / "run"
    options = {**SMALL, "settings": {"simulator": "toy-cell"}, "identifiability": False}
    bsa.calibrate(toy_task(), out=folder, max_tokens=200, **options)
    told = f"200 tokens used of --max-tokens 200. Go on with: calibrate(resume={str(folder)!r}, max_tokens=400)"
    assert told in capsys.readouterr().err
    assert bsa.calibrate(resume=folder, identifiability=False, progress=False).status == "budget-spent"
    assert told in capsys.readouterr().err


def test_a_server_that_is_not_there_is_told_before_any_simulation(tmp_path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"http://127.0.0.1:{listener.getsockname()[1]}/v1"
    settings = {"simulator": "toy-cell"}
    with pytest.raises(BsaError, match="nothing listens"):
        bsa.calibrate(toy_task(), settings=settings, out=tmp_path / "x", backend="openai:m", base_url=address, **SMALL)
    assert not (tmp_path / "x").exists()
