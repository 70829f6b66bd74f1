"""What a name means does not depend on the folder that the server was started in."""

from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.mcp_server import functions
from bsa.experiments.tasks.find import PACKAGED


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


def test_what_a_journal_names_is_known_before_it_is_gone_on_with(monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"data": [{"path": "/a.csv", "joined": ["/b.csv"]}], "holdout": [], "parameters": "/run", "search": "all"}
    for event, expected in [
        ({"config": {"backend": "manual"}}, ({"backend": "manual"}, [])),
        ({"options": options}, (options, ["/a.csv", "/b.csv", "/run"])),
        ({}, ({}, [])),
    ]:
        monkeypatch.setattr(functions, "read_events", lambda folder, event=event: iter([event]))
        assert functions.begun_with(Path("run")) == expected
