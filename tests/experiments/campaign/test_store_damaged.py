"""What was damaged in a store is made again, or refused in one line; one bad cell never stops a grid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.campaign.cell import carry_out
from bsa.experiments.campaign.execution import run_cells
from bsa.experiments.campaign.page import build_page
from bsa.experiments.campaign.results import read_manifest, rows_of
from bsa.experiments.campaign.running import plan_grid
from bsa.experiments.campaign.trace import read_trace

from .conftest import Here, Quiet, noted, write_grid

BAD: list[Any] = [None, [], {}, "text", 3, {"status": "finished"}, {"status": "finished", "best": [], "initial": {}}]


def finish(plan):
    run_cells(plan.cells, plan.store, Here(), Quiet())
    noted(plan)
    return plan.folder


def test_a_damaged_task_file_is_made_again(tmp_path: Path) -> None:
    path = write_grid(tmp_path / "grid", tasks=1)
    plan = plan_grid(str(path), tmp_path / "store")
    (task,) = (tmp_path / "store" / "tasks").glob("*.json")
    whole = task.read_bytes()
    for damage in (b"", b"{", b"[]", whole[:-10], whole.replace(b"toy-0", b"toy-1")):
        task.write_bytes(damage)
        assert not plan.store.has_task(task.stem)
        with pytest.raises(BsaError, match="missing or damaged"):
            plan.store.get_task(task.stem)
        plan_grid(str(path), tmp_path / "store")
        assert task.read_bytes() == whole


@pytest.mark.parametrize("content", BAD, ids=str)
def test_a_damaged_result_is_made_again_from_the_journal(content: Any, tmp_path: Path) -> None:
    plan = plan_grid(str(write_grid(tmp_path / "grid", tasks=1, scaffolds=["full"])), tmp_path / "store")
    folder = finish(plan)
    identity = plan.cells[0].identity
    before = rows_of(read_manifest(folder), plan.store)
    cell = plan.store.cell(identity)
    for name in ("result.json", "trace.json", "failure.json"):
        (cell / name).write_text(json.dumps(content))
    assert plan.store.result(identity) is None
    assert len(read_trace(plan.store.cell(identity)).objective) == before[0]["simulations"]
    assert rows_of(read_manifest(folder), plan.store)[0]["state"] in ("stopped", "failed")
    build_page(folder, plan.store.root)
    finish(plan)
    (after,) = rows_of(read_manifest(folder), plan.store)
    assert (after["state"], after["objective"]) == ("done", before[0]["objective"])


@pytest.mark.parametrize("content", [[], {}, {"cells": []}, {"grid": {}, "cells": 3, "methods": []}], ids=str)
def test_a_damaged_manifest_is_refused(content: Any, tmp_path: Path) -> None:
    (tmp_path / "grid.json").write_text(json.dumps(content))
    with pytest.raises(BsaError, match=r"give its command again|does not read as a grid"):
        read_manifest(tmp_path)


def test_a_cell_whose_place_is_taken_does_not_stop_the_grid(tmp_path: Path) -> None:
    plan = plan_grid(str(write_grid(tmp_path / "grid", tasks=2, scaffolds=["full"])), tmp_path / "store")
    places = [plan.store.cell(cell.identity) for cell in plan.cells]
    places[0].parent.mkdir(parents=True)
    places[0].write_text("a file where a folder should be")
    reports = run_cells(plan.cells, plan.store, Here(), Quiet())
    assert [reports[cell.identity].state for cell in plan.cells] == ["failed", "done"]
    assert str(places[0]) in reports[plan.cells[0].identity].reason
    assert places[0].read_text() == "a file where a folder should be"


def test_a_foreign_journal_in_a_cell_is_a_failed_cell(tmp_path: Path) -> None:
    plan = plan_grid(str(write_grid(tmp_path / "grid", tasks=1, scaffolds=["full"])), tmp_path / "store")
    journal = plan.store.cell(plan.cells[0].identity) / "journal.jsonl"
    journal.parent.mkdir(parents=True)
    for content in ("not ours", '{"event":"run","config":3}\n', '{"event":"run"}\n[]\n'):
        journal.write_text(content)
        report = carry_out(plan.cells[0], plan.store)
        assert report.state == "failed"
        assert journal.read_text() == content
