"""What a name means does not depend on the folder that the server was started in."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.mcp_server import functions
from bsa.experiments.tasks.find import PACKAGED, find_task


@pytest.fixture
def started_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that the tools may not read, with records and a run in it."""
    for name in ("records", "run"):
        (tmp_path / name).mkdir()
    (tmp_path / "records" / "a.csv").write_bytes((PACKAGED / "demo.csv").read_bytes())
    (tmp_path / "run" / "journal.jsonl").write_text('{"event":"run"}\n')
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_data_by_a_name_are_a_task(started_in: Path) -> None:
    with pytest.raises(BsaError, match='there is no task "records"'):
        functions.calibrate({"data": "records", "parameters": None, "out": started_in / "out"})


@pytest.mark.parametrize("function", [functions.calibrate, functions.discover])
def test_parameters_by_a_name_are_an_installed_set(function: Any, started_in: Path) -> None:
    asked = {"data": [started_in / "records" / "a.csv"], "parameters": "run", "out": started_in / "out"}
    with pytest.raises(BsaError, match='there is no parameter set "run"'):
        function(asked)


@pytest.mark.parametrize("function", [functions.simulate, functions.sensitivities])
def test_values_are_tried_in_an_installed_set(function: Any, started_in: Path) -> None:
    with pytest.raises(BsaError, match='there is no parameter set "run"'):
        function([started_in / "records" / "a.csv"], {}, {"parameters": "run"}, {})


@pytest.mark.slow
def test_effects_at_a_bound_are_those_of_a_step_to_the_other_side() -> None:
    mass = find_task("oscillator").space["Mass [kg]"]
    found = functions.sensitivities("oscillator", {}, {}, {mass.name: mass.upper})
    below = functions.simulate("oscillator", {}, {}, {mass.name: mass.upper / 1.1})["feedback"]["features"]
    for name, change in found["changes"][mass.name].items():
        assert found["features"][name] - below[name] == pytest.approx(change, rel=0.05, abs=2e-3)
    assert any(found["changes"][mass.name].values())


def _begun(folder: Path, **event: Any) -> Path:
    folder.mkdir()
    (folder / "journal.jsonl").write_text(json.dumps({"event": "run", **event}) + "\n")
    return folder


def test_what_a_calibration_was_begun_with(tmp_path: Path) -> None:
    assert functions.begun_with(_begun(tmp_path / "run", config={"backend": "manual"})) == ({"backend": "manual"}, [])
    assert functions.begun_with(_begun(tmp_path / "nothing")) == ({}, [])


@pytest.mark.parametrize(
    ("others", "read"),
    [
        ({"parameters": "/run", "search": "all"}, ["/run"]),
        ({"parameters": "Chen2020", "search": "/own.yaml"}, ["/own.yaml"]),
        ({"parameters": "../run", "search": "own.yaml"}, ["../run", "own.yaml"]),
        ({"parameters": "Chen2020", "search": {}, "backend": "manual"}, []),
        ({"parameters": "Chen2020", "config": {}}, []),
    ],
)
def test_what_a_discovery_was_begun_with(others: Any, read: list[str], tmp_path: Path) -> None:
    config = {"config": others.pop("config")} if "config" in others else {}
    files = {
        "data": [{"path": "/a.csv", "joined": ["/b.csv"]}],
        "holdout": ["/c.csv"],
        "reference": ["/d.csv", "e.csv"],
    }
    folder = _begun(tmp_path / "run", kind="discovery", options={**files, **others}, **config)
    begun, paths = functions.begun_with(folder)
    assert (begun["parameters"], begun["backend"]) == (others["parameters"], others.get("backend"))
    assert paths == ["/a.csv", "/b.csv", "/c.csv", "/d.csv", "e.csv", *read]


def test_parameters_of_a_discovery_that_goes_on_are_an_installed_set(started_in: Path) -> None:
    options = {"data": [str(started_in / "records" / "a.csv")], "parameters": "run"}
    folder = _begun(started_in / "begun", kind="discovery", options=options)
    with pytest.raises(BsaError, match='there is no parameter set "run"'):
        functions.discover({"resume": folder})


@pytest.mark.slow
def test_the_import_loads_no_heavy_library() -> None:
    """The process of every call imports it."""
    heavy = "{'pybamm', 'pandas', 'matplotlib', 'litellm', 'torch'}"
    code = f"import bsa.experiments.mcp_server.functions, sys; assert not {heavy} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
