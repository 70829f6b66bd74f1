"""What a person sees while a grid goes on."""

import io

import pytest
from bsa.experiments.campaign.cell import Report
from bsa.experiments.campaign.execution import run_cells
from bsa.experiments.campaign.progress import LiveCampaign, PlainCampaign

from .conftest import Here


def failing(plan):
    """A pool in which the first cell fails and the second loses its worker once."""
    pool, (first, second, *_) = Here(), [cell.identity for cell in plan.cells]

    def lost(order):
        del pool.answers[second]
        return Report(order.identity, "lost", reason="its worker died")

    pool.answers = {
        first: lambda order: Report(order.identity, "failed", reason="\x1b[31mno such server\nat all"),
        second: lost,
    }
    return pool


def test_plain_lines(make_plan):
    plan = make_plan()
    stream = io.StringIO()
    with PlainCampaign(plan.cells, stream) as watcher:
        run_cells(plan.cells, plan.store, failing(plan), watcher)
    lines = stream.getvalue().splitlines()
    assert lines[0] == "toy-0 · full · rules · seed 1: failed: no such server at all"
    assert lines[1] == "toy-0 · no-memory · rules · seed 1: its worker died; run again"
    assert lines[-1].startswith("3 of 4 cells done (0 were already), 1 failed")
    assert "\x1b" not in stream.getvalue()


def test_a_live_table(make_plan, capsys):
    plan = make_plan()
    with LiveCampaign("toys", plan.cells) as watcher:
        run_cells(plan.cells, plan.store, failing(plan), watcher)
    shown = capsys.readouterr().err
    assert "no such server at all" in shown
    assert "full · rules" in shown


def test_counts_by_method_and_time_left(make_plan):
    plan = make_plan()
    count = PlainCampaign(plan.cells, io.StringIO())
    assert str(count.left_s) == "nan"
    cell = plan.cells[0]
    count.begun(cell)
    assert (count.total.running, count.tallies["full · rules"].running) == (1, 1)
    count.ended(cell, Report(cell.identity, "done", {"best": {"objective": 0.5}}), found=False)
    count.ended(plan.cells[1], Report(plan.cells[1].identity, "done"), found=True)
    assert (count.total.total, count.total.done, count.total.running) == (4, 2, 0)
    assert count.tallies["full · rules"].best == 0.5
    assert count.left_s == pytest.approx(count.seconds * 2, rel=0.5)
