"""An item of a study is a cell like others: carried out once, kept, and told when it fails."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from bsa.experiments.campaign.cell import Order, Report
from bsa.experiments.campaign.execution import LOSSES, run_cells
from bsa.experiments.campaign.results import rows_of, write_manifest
from bsa.experiments.campaign.running import run_campaign
from bsa.experiments.campaign.study_cell import plan_study, results_of

from .conftest import Here, Quiet, noted


def halved(folder: Path, number: float, seed: int = 0) -> dict[str, Any]:
    if number < 0:
        raise ValueError("a number below 0")
    return {"half": number / 2, "summary": f"half of {number} is {number / 2}"}


def carried_out(store: Path, items: dict[str, dict[str, Any]]) -> tuple[list[Any], list[dict[str, Any]], list[str]]:
    plan, pool = plan_study("halves", halved, items, store), Here()
    rows, remarks = run_campaign(plan, pool, lambda plan, pool: Quiet())
    assert not remarks
    assert (plan.folder / "cells.csv").is_file()
    return rows, results_of(plan), pool.carried


def test_an_item_is_carried_out_once_and_a_failure_is_told(tmp_path: Path) -> None:
    items = {"four": {"number": 4.0}, "below": {"number": -1.0, "seed": 7}}
    rows, found, carried = carried_out(tmp_path / "store", items)
    assert [(row["task"], row["state"], row["seed"]) for row in rows] == [("four", "done", 0), ("below", "failed", 7)]
    assert rows[1]["reason"] == "ValueError: a number below 0"
    assert [result["half"] for result in found] == [2.0]
    assert len(carried) == 2
    more = {"six": {"number": 6.0}, **items}
    _, found, carried = carried_out(tmp_path / "store", more)
    assert [result["half"] for result in found] == [3.0, 2.0]
    assert len(carried) == 2, "what is done is not done again, what failed is"


def test_rows_are_those_of_the_plan_where_another_process_has_begun_the_study_anew(tmp_path: Path) -> None:
    plan = plan_study("halves", halved, {"four": {"number": 4.0}}, tmp_path)
    other = plan_study("halves", halved, {"six": {"number": 6.0}}, tmp_path)

    class Meanwhile(Here):
        def submit(self, order: Order) -> None:
            write_manifest(other.about, other.cells, other.folder)
            super().submit(order)

    rows, _ = run_campaign(plan, Meanwhile(), lambda plan, pool: Quiet())
    assert [(row["task"], row["state"]) for row in rows] == [("four", "done")]


def test_an_item_that_fits_in_a_folder_of_its_own_is_known_to_get_further(tmp_path: Path) -> None:
    plan, pool = plan_study("halves", halved, {"four": {"number": 4.0}}, tmp_path / "store"), Here()
    (cell,) = plan.cells
    journal = plan.store.cell(cell.identity) / "fit" / "journal.jsonl"
    journal.parent.mkdir(parents=True)

    def further(order: Any) -> Report:
        with journal.open("a") as file:
            file.write("x" * 100)
        if Counter(pool.carried)[cell.identity] > LOSSES:
            pool.answers.clear()
        return Report(order.identity, "lost")

    pool.answers[cell.identity] = further
    further(cell)
    assert [row["state"] for row in rows_of(noted(plan), plan.store)] == ["stopped"]
    assert run_cells(plan.cells, plan.store, pool, Quiet())[cell.identity].state == "done"
