"""What a person sees while a grid goes on."""

import io
from dataclasses import replace

import pytest
from bsa.experiments.campaign.cell import Report
from bsa.experiments.campaign.execution import run_cells
from bsa.experiments.campaign.progress import LiveCampaign, PlainCampaign, named
from rich.console import Console

from .conftest import Here


def failing(plan):
    """A pool in which the first cell fails and the second loses its worker once."""
    pool, (first, second, *_) = Here(), [cell.identity for cell in plan.cells]

    def lost(cell):
        del pool.answers[second]
        return Report(cell.identity, "lost", reason="its worker died")

    pool.answers = {
        first: lambda cell: Report(cell.identity, "failed", reason="\x1b[31mno such server\nat all"),
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


@pytest.mark.slow
def test_a_cell_of_another_process_is_not_running_here(make_plan):
    plan = make_plan()
    pool, busy = Here(), plan.cells[0].identity

    def other_has_it(cell):
        pool.answers.clear()
        return Report(cell.identity, "busy")

    pool.answers[busy] = other_has_it
    watcher = PlainCampaign(plan.cells, io.StringIO())
    run_cells(plan.cells, plan.store, pool, watcher)
    assert (watcher.total.done, watcher.total.running) == (4, 0)


def test_names_of_ones_own_neither_format_nor_steer_a_terminal(make_plan):
    plan = make_plan()
    (cell, *_) = plan.cells
    scaffold = cell.config.scaffold.model_copy(update={"name": "my[red]\x1b[2J[/x]scaffold"})
    odd = replace(cell, config=cell.config.model_copy(update={"scaffold": scaffold}))
    console = Console(file=io.StringIO(), width=120)
    console.print(LiveCampaign("toys", [odd]).drawn())
    shown = console.file.getvalue()
    assert all(part in shown for part in ("my[red]", "[/x]scaffold"))
    assert "\x1b" not in shown
    assert "\x1b" not in named(odd)


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
