"""Grids are run once, whoever runs them and however often they are killed."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.messages import BackendUnreachable, Reply, Usage
from bsa.core.run.allowance import UNLIMITED, Allowance
from bsa.core.run.journal import FORMAT, LOCK, Journal
from bsa.experiments.campaign import calibration
from bsa.experiments.campaign.cell import Report, carry_out
from bsa.experiments.campaign.execution import LOSSES, run_cells
from bsa.experiments.campaign.local_pool import LocalPool
from bsa.experiments.campaign.model_places import SharedBackend
from bsa.experiments.campaign.results import rows_of
from bsa.experiments.campaign.running import run_campaign
from bsa.experiments.campaign.store import Store
from filelock import FileLock

from .conftest import Here, Quiet, noted, write_grid

NUMBERS = ("task", "method", "seed", "mape", "rmse", "v_rmse_mv", "simulations", "identity")


def numbers(rows):
    return [{name: row[name] for name in NUMBERS} for row in rows]


def run_here(plan, pool=None, watcher=None, allowance=UNLIMITED):
    return run_cells(plan.cells, plan.store, pool or Here(), watcher or Quiet(), allowance)


def indices(store: Store, identity: str) -> Counter:
    """How often each simulation stands in a cell's journal."""
    lines = (store.cell(identity) / "journal.jsonl").read_text().splitlines()
    return Counter(event["index"] for event in map(json.loads, lines) if event["event"] == "trial")


def test_finished_cells_are_not_run_again(make_plan):
    plan = make_plan()
    first, second = Quiet(), Quiet()
    reports = run_here(plan, watcher=first)
    again = run_here(plan, watcher=second)
    assert (len(first.ran), len(first.found), len(second.ran), len(second.found)) == (4, 0, 0, 4)
    assert {key: report.result for key, report in reports.items()} == {
        key: report.result for key, report in again.items()
    }


@pytest.mark.slow
def test_grids_share_cells(make_plan):
    run_here(make_plan(seeds=[1]))
    watcher = Quiet()
    run_here(make_plan(name="larger", seeds=[1, 2]), watcher=watcher)
    assert (len(watcher.found), len(watcher.ran)) == (4, 4)


def test_a_cell_of_another_process_is_left_to_it(make_plan):
    plan = make_plan(tasks=1, scaffolds=["full"])
    (cell,) = plan.cells
    with FileLock(plan.store.cell(cell.identity) / LOCK):
        assert carry_out(cell, plan.store).state == "busy"
    assert carry_out(cell, plan.store).state == "done"


@pytest.mark.slow
def test_busy_cells_are_looked_at_again(make_plan):
    plan = make_plan()
    pool, busy = Here(), plan.cells[0].identity

    def other_has_it(cell):
        pool.answers.clear()
        return Report(cell.identity, "busy")

    pool.answers[busy] = other_has_it
    reports = run_here(plan, pool)
    assert [report.state for report in reports.values()] == ["done"] * 4
    assert Counter(pool.carried)[busy] == 2
    assert pool.carried[-1] == busy


def test_a_cell_that_kills_its_workers_is_given_up(make_plan):
    plan = make_plan()
    pool, deadly = Here(), plan.cells[1].identity
    pool.answers[deadly] = lambda cell: Report(cell.identity, "lost", reason="its worker died (exit code -9)")
    reports = run_here(plan, pool)
    assert Counter(pool.carried)[deadly] == LOSSES
    assert reports[deadly].state == "lost"
    assert sorted(report.state for report in reports.values()) == ["done", "done", "done", "lost"]


def test_a_cell_that_gets_further_each_time_is_not(make_plan):
    plan = make_plan(tasks=1, scaffolds=["full"])
    pool = Here()
    (cell,) = plan.cells
    journal = plan.store.cell(cell.identity) / "journal.jsonl"
    journal.parent.mkdir(parents=True)
    left = list(range(3 * LOSSES))

    def further(cell):
        left.pop()
        if not left:
            journal.unlink()
            pool.answers.clear()
        else:
            with journal.open("a") as file:
                file.write("x" * 100)
        return Report(cell.identity, "lost")

    pool.answers[cell.identity] = further
    assert run_here(plan, pool)[cell.identity].state == "done"


def test_a_failing_cell_costs_itself_alone_and_is_tried_again(make_plan):
    plan = make_plan(backends=["rules", "openai:nothing"], tasks=1, scaffolds=["full"])
    reports = run_here(plan)
    assert sorted(report.state for report in reports.values()) == ["done", "failed"]
    failed = next(report for report in reports.values() if report.state == "failed")
    assert "base" in failed.reason or "server" in failed.reason
    assert (plan.store.cell(failed.identity) / "failure.json").is_file()
    watcher = Quiet()
    run_here(plan, watcher=watcher)
    assert watcher.ran == [failed.identity]


def test_a_cell_without_a_model_has_failed_and_is_tried_again(make_plan, monkeypatch):
    plan = make_plan(tasks=1, scaffolds=["full"], seeds=[1, 2])
    manifest = noted(plan)

    class Dead(RulesBackend):
        def complete(self, messages, schema, *, seed):
            raise BackendUnreachable("nothing listens")

    monkeypatch.setattr(calibration, "_backend", lambda cell, store: Dead())
    for lost in (1, 2):
        reports = run_here(plan)
        assert [(report.state, report.result) for report in reports.values()] == [("failed", {})] * 2
        for seen in (reports, None):
            rows = rows_of(manifest, plan.store, seen)
            assert [(row["state"], row["lost_calls"], row["mape"]) for row in rows] == [("failed", lost, None)] * 2
            assert rows[0]["reason"] == "the language model gave no reply: nothing listens"
    monkeypatch.setattr(calibration, "_backend", lambda cell, store: RulesBackend())
    assert {report.state for report in run_here(plan).values()} == {"done"}
    rows = rows_of(manifest, plan.store)
    assert [(row["state"], row["lost_calls"], row["reason"]) for row in rows] == [("done", 2, "")] * 2
    monkeypatch.undo()
    steady = make_plan("steady", tasks=1, scaffolds=["full"], seeds=[1, 2])
    run_here(steady)
    again = rows_of(noted(steady), steady.store)
    assert numbers(again) == numbers(rows)


def test_nothing_is_begun_once_the_allowance_is_spent(make_plan):
    plan = make_plan(tasks=3)
    pool = Here()
    for cell in plan.cells:
        pool.answers[cell.identity] = lambda cell: Report(cell.identity, "done", {"tokens": 600, "cost_usd": 0.5})
    assert len(run_here(plan, pool, allowance=Allowance(max_tokens=1000))) == 2
    assert len(run_here(plan, pool, allowance=Allowance(max_cost_usd=1.2))) == 3


def pay(plan, identity, usage):
    """A reply in a cell's journal."""
    with closing(Journal(plan.store.cell(identity))) as journal:
        if journal.path.stat().st_size == 0:
            journal.append("run", format=FORMAT)
        journal.append("reply", **asdict(Reply("{}", usage)), prompt=[])


@pytest.mark.parametrize(("state", "more"), [("failed", 2), ("stopped", 2), ("lost", 1)])
def test_what_cells_without_a_result_spent_counts_for_the_allowance(make_plan, state, more):
    """An outage, an error, an interrupt and a worker that dies keep what was paid in the journal.

    The second time, what a cell had cost the first time counts too; a cell that lost its worker is run again at once.
    """
    plan = make_plan(tasks=3)
    pool = Here()

    def spend(cell):
        pay(plan, cell.identity, Usage(prompt_tokens=500, completion_tokens=100, cost_usd=0.5))
        return Report(cell.identity, state)

    pool.answers = dict.fromkeys((cell.identity for cell in plan.cells), spend)
    run_here(plan, pool, allowance=Allowance(max_tokens=1000))
    assert len(pool.carried) == 2
    run_here(plan, pool, allowance=Allowance(max_cost_usd=1.2))
    assert len(pool.carried) == 2 + more


def test_a_cell_that_is_run_again_costs_what_its_last_end_says(make_plan):
    plan = make_plan(tasks=1, scaffolds=["full", "no-memory"])
    pool = Here()
    first, second = (cell.identity for cell in plan.cells)

    def dies(cell):
        pay(plan, first, Usage(prompt_tokens=400))
        pool.answers[first] = lambda cell: Report(first, "done", {"tokens": 900, "cost_usd": None})
        return Report(first, "lost")

    pool.answers = {first: dies, second: lambda cell: Report(second, "done", {"tokens": 1})}
    assert set(run_here(plan, pool, allowance=Allowance(max_tokens=1000))) == {first, second}


@pytest.mark.slow
def test_worker_processes_find_the_same_as_this_one(make_plan):
    here, there = make_plan(store="here"), make_plan(store="there")
    run_here(here)
    pool = LocalPool(2, cells_per_worker=1)
    rows, remarks = run_campaign(there, pool, Quiet())
    assert not remarks
    assert numbers(rows) == numbers(rows_of(noted(there), here.store))
    assert [row["state"] for row in rows] == ["done"] * 4
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_killed_workers_are_replaced_and_their_cells_resumed(make_plan):
    calm, rough = (
        make_plan(store="calm", rounds=12, simulations=15),
        make_plan(store="rough", rounds=12, simulations=15),
    )
    run_here(calm)
    pool, watcher = LocalPool(2), Quiet()
    stop = threading.Event()

    def kill():
        killed = 0
        # One kill less than gives a cell up: on a busy machine all of them may hit one cell before it gets further.
        while not stop.is_set() and killed < LOSSES - 1:
            busy = [worker for worker in list(pool._workers) if worker.cell is not None]
            started = [w for w in busy if rough.store.journal_size(w.cell.identity) > 3000]
            if started:
                os.kill(started[0].process.pid, signal.SIGKILL)
                killed += 1
                time.sleep(0.5)
            time.sleep(0.005)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        rows, _ = run_campaign(rough, pool, watcher)
    finally:
        stop.set()
        killer.join()
    assert watcher.losses
    assert numbers(rows) == numbers(rows_of(noted(rough), calm.store))
    for cell in rough.cells:
        assert set(indices(rough.store, cell.identity).values()) == {1}


@pytest.mark.slow
def test_two_processes_on_one_grid_share_it_and_a_killed_one_is_made_good(tmp_path):
    path = write_grid(tmp_path, tasks=3, seeds=[1, 2], rounds=8, simulations=12)
    call = [sys.executable, "-c", "from bsa.experiments.cli.main import main; main()"]
    command = [*call, "grid", str(path), "--store", str(tmp_path / "store"), "--workers", "1"]
    doomed = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    cells = tmp_path / "store" / "cells"
    deadline = time.monotonic() + 120
    while len(list(cells.glob("*/result.json"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    doomed.kill()
    doomed.wait()
    done = {found.parent.name: found.stat().st_mtime_ns for found in cells.glob("*/result.json")}
    assert 3 <= len(done) < 12
    pair = [subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) for _ in range(2)]
    words = [process.communicate(timeout=240)[1].decode() for process in pair]
    assert [process.returncode for process in pair] == [0, 0], words
    for found in cells.glob("*/result.json"):
        assert done.get(found.parent.name, found.stat().st_mtime_ns) == found.stat().st_mtime_ns
        journal = [json.loads(line) for line in (found.parent / "journal.jsonl").read_text().splitlines()]
        kinds = Counter(event["event"] for event in journal)
        # The one that was under way when the first process was killed may have been resumed, once.
        assert (kinds["run"], kinds["end"]) == (1, 1)
        assert kinds.get("resumed", 0) <= 1
        assert set(indices(Store(tmp_path / "store"), found.parent.name).values()) == {1}
    assert len(list(cells.glob("*/result.json"))) == 12


class Slow:
    """A backend that notes how many ask it at once."""

    name, sees_images = "slow", False

    def __init__(self) -> None:
        self.now = self.most = 0
        self.lock = threading.Lock()

    def complete(self, messages, schema, *, seed):
        with self.lock:
            self.now += 1
            self.most = max(self.most, self.now)
        time.sleep(0.02)
        with self.lock:
            self.now -= 1
        return Reply("{}")

    def close(self):
        pass


@pytest.mark.parametrize("places", [1, 2])
def test_a_model_server_is_asked_by_few_at_a_time(tmp_path: Path, places: int):
    slow = Slow()
    threads = [
        threading.Thread(target=SharedBackend(slow, tmp_path, places).complete, args=((), {}), kwargs={"seed": 0})
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert slow.most == places
