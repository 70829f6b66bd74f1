"""An item of a study is a cell like others: carried out once, kept, and told when it fails."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.campaign.cell import Cell, Report
from bsa.experiments.campaign.execution import LOSSES, run_cells
from bsa.experiments.campaign.page import build_page
from bsa.experiments.campaign.results import rows_of, write_manifest
from bsa.experiments.campaign.running import run_campaign
from bsa.experiments.campaign.store import Store
from bsa.experiments.campaign.study_cell import plan_study, rows_found, write_found

from .conftest import Here, Quiet, noted


def halved(folder: Path, number: float, seed: int = 0) -> dict[str, Any]:
    if number < 0:
        raise ValueError("a number below 0")
    return {"rows": [{"half": number / 2}], "summary": f"half of {number} is {number / 2}"}


def carried_out(store: Path, items: dict[str, dict[str, Any]]) -> tuple[list[Any], list[dict[str, Any]], list[str]]:
    plan, pool = plan_study("halves", halved, items, store), Here()
    rows, remarks = run_campaign(plan, pool, Quiet())
    assert not remarks
    assert (plan.folder / "cells.csv").is_file()
    return rows, [row["half"] for row in rows_found(plan)], pool.carried


def test_an_item_is_carried_out_once_and_a_failure_is_told(tmp_path: Path) -> None:
    items = {"four": {"number": 4.0}, "below": {"number": -1.0, "seed": 7}}
    rows, found, carried = carried_out(tmp_path / "store", items)
    assert [(row["task"], row["state"], row["seed"]) for row in rows] == [("four", "done", 0), ("below", "failed", 7)]
    assert rows[1]["reason"] == "ValueError: a number below 0"
    assert found == [2.0]
    assert len(carried) == 2
    more = {"six": {"number": 6.0}, **items}
    _, found, carried = carried_out(tmp_path / "store", more)
    assert found == [3.0, 2.0]
    assert len(carried) == 2, "what is done is not done again, what failed is"


def test_rows_are_those_of_the_plan_where_another_process_has_begun_the_study_anew(tmp_path: Path) -> None:
    plan = plan_study("halves", halved, {"four": {"number": 4.0}}, tmp_path)
    other = plan_study("halves", halved, {"six": {"number": 6.0}}, tmp_path)

    class Meanwhile(Here):
        def submit(self, cell: Cell, store: Store) -> None:
            write_manifest(other.about, other.cells, other.folder)
            super().submit(cell, store)

    rows, _ = run_campaign(plan, Meanwhile(), Quiet())
    assert [(row["task"], row["state"]) for row in rows] == [("four", "done")]


def test_an_item_that_fits_in_a_folder_of_its_own_is_known_to_get_further(tmp_path: Path) -> None:
    plan, pool = plan_study("halves", halved, {"four": {"number": 4.0}}, tmp_path / "store"), Here()
    (cell,) = plan.cells
    journal = plan.store.cell(cell.identity) / "fit" / "journal.jsonl"
    journal.parent.mkdir(parents=True)

    def further(cell: Cell) -> Report:
        with journal.open("a") as file:
            file.write("x" * 100)
        if Counter(pool.carried)[cell.identity] > LOSSES:
            pool.answers.clear()
        return Report(cell.identity, "lost")

    pool.answers[cell.identity] = further
    further(cell)
    assert [row["state"] for row in rows_of(noted(plan), plan.store)] == ["stopped"]
    assert run_cells(plan.cells, plan.store, pool, Quiet())[cell.identity].state == "done"


def read(folder: Path, file: Path, name: str) -> dict[str, Any]:
    rows = [{"name": name, "length": len(file.read_text())}]
    return {"rows": rows, "letters": [{"letter": letter} for letter in file.read_text()], "summary": "read"}


def test_a_file_counts_by_its_content_and_one_that_is_missing_fails_alone(tmp_path: Path) -> None:
    for place in ("here", "there"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "a.txt").write_text("ab")

    def plan(place: str) -> Any:
        items = {name: {"file": tmp_path / place / f"{name}.txt", "name": name} for name in ("a", "b")}
        return plan_study("two-files", read, items, tmp_path / "store")

    first = plan("here")
    assert first.cells[0].identity == plan("there").cells[0].identity
    (tmp_path / "there" / "a.txt").write_text("abc")
    assert first.cells[0].identity != plan("there").cells[0].identity
    rows, _ = run_campaign(first, Here(), Quiet())
    assert [(row["task"], row["state"]) for row in rows] == [("a", "done"), ("b", "failed")]
    assert rows[1]["reason"] == f"there is no file {tmp_path / 'here' / 'b.txt'}."


def test_what_is_found_is_written_part_by_part(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("ab")
    plan = plan_study("two-files", read, {"a": {"file": tmp_path / "a.txt", "name": "a"}}, tmp_path / "store")
    assert write_found(plan, repr) == ""
    assert not plan.folder.exists()
    run_campaign(plan, Here(), Quiet())
    assert write_found(plan, lambda rows: f"{len(rows)} row") == "1 row"
    assert write_found(plan, lambda rows: f"{len(rows)} letters", "letters") == "2 letters"
    written = {name: (plan.folder / name).read_text().split() for name in ("two_files.csv", "two_files.md")}
    assert written == {"two_files.csv": ["name,length", "a,2"], "two_files.md": ["1", "row"]}
    assert (plan.folder / "letters.csv").read_text().split() == ["letter", "a", "b"]


def test_an_item_that_a_study_has_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BsaError, match='no item "fuor"') as refused:
        plan_study("halves", halved, {"four": {"number": 4.0}}, tmp_path, ["fuor"])
    assert "four" in refused.value.hint


def test_the_page_of_a_study_is_written_with_full_reports_too(tmp_path: Path) -> None:
    """Its items have no report of their own."""
    carried_out(tmp_path / "store", {"four": {"number": 4.0}})
    assert "halves" in build_page("halves", tmp_path / "store", full=True).read_text()
