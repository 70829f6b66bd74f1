"""Studies on the toy cell: resumable, deterministic, and right in their arithmetic."""

from __future__ import annotations

import json
import math
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.errors import BsaError
from bsa.core.messages import BackendUnreachable, Outage, Reply
from bsa.core.scaffold import Scaffold
from bsa.core.simulation import ExperimentRun
from bsa.core.task import Task
from bsa.experiments.studies import cell as cell_module
from bsa.experiments.studies import many, recovery
from bsa.experiments.studies.cell import CellRecord, CellTrial, finished, run_cell
from bsa.experiments.studies.many import make_cells, run_cells
from bsa.experiments.studies.recovery import recovery_study, within_case
from bsa.experiments.studies.runtime import runtime_study
from bsa.experiments.studies.suite import suite_study
from bsa.experiments.studies.table import REPORTED, main_table, markdown, paper_rows, rows_of, statistic
from bsa.experiments.studies.warmup import warmup_study, with_warm_up
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import CAPACITY, HIDDEN, SERIES, record, space, toy_scaffold, toy_task

CASES = [
    SuiteCase("regular", 1, "Chen2020", 1.0, 1.0, HIDDEN),
    SuiteCase("extreme", 2, "Ecker2015", 1.0, 2.0, {**HIDDEN, CAPACITY: 1.6}),
]


def quiet(text: str) -> None:
    pass


@pytest.fixture(autouse=True)
def toy_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(case: SuiteCase, search: object = None, cache: Path | None = None) -> Task:
        return toy_task(case.hidden, case.key)

    monkeypatch.setattr(cell_module, "build_task", build)
    monkeypatch.setattr(recovery, "build_task", build)


def scaffolds(*names: str) -> list[Scaffold]:
    return [toy_scaffold(name) for name in names]


def test_a_suite_study_writes_its_table(tmp_path: Path) -> None:
    said: list[str] = []
    records = suite_study(
        CASES, tmp_path, scaffolds("default", "random", "cma-es"), simulations=12, workers=1, say=said.append
    )
    assert [(r.case, r.method) for r in records][:3] == [
        ("regular-1", "default"),
        ("regular-1", "random"),
        ("regular-1", "cma-es"),
    ]
    assert [r.simulations for r in records] == [1, 12, 12] * 2
    table = (tmp_path / "table.md").read_text()
    assert "| *paper agent O3* | 12.60±24.50 |" in table
    assert "**" in table
    assert (tmp_path / "cells.csv").read_text().count("\n") == 7
    content = json.loads((tmp_path / "table.json").read_text())
    assert content["mape"]["regular"]["default"]["Chen2020"]["deviation"] is None
    for name in ("by_mode.png", "by_set.png", "by_rate.png"):
        assert (tmp_path / name).stat().st_size > 1000
    assert any("about" in line for line in said)
    assert any("left" in line for line in said)


def test_finished_cells_are_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = make_cells(CASES, scaffolds("random"), 6, 1)
    first = run_cells(cells, tmp_path, say=quiet)
    monkeypatch.setattr(cell_module, "execute_run", _not_again)
    assert run_cells(cells, tmp_path, say=quiet) == first


def test_another_budget_seed_or_method_is_another_cell() -> None:
    cells = [
        *make_cells(CASES, scaffolds("random"), 6, 1),
        *make_cells(CASES, scaffolds("random"), 7, 1),
        *make_cells(CASES, scaffolds("random"), 6, 2),
        *make_cells(CASES, scaffolds("de"), 6, 1),
    ]
    assert len({cell.identity for cell in cells}) == len(cells)
    assert make_cells(CASES, scaffolds("random"), 6, 1)[0].identity == cells[0].identity


def test_a_base_cell_may_have_a_budget_of_its_own() -> None:
    cells = make_cells(CASES, scaffolds("random"), 6, 1, own_budgets={CASES[0].parameter_set: 3})
    expected = {case.key: 3 if case.parameter_set == CASES[0].parameter_set else 6 for case in CASES}
    assert {cell.case.key: cell.config.simulations for cell in cells} == expected
    with pytest.raises(BsaError, match='did you mean "Chen2020"'):
        make_cells(CASES, scaffolds("random"), 6, 1, own_budgets={"Chen2002": 3})


def test_an_interrupted_cell_goes_on_from_its_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = make_cells(CASES, scaffolds("random"), 25, 1)[0]
    whole = run_cell(cell, tmp_path / "whole")
    interrupting = _Interrupting(cell_module.execute_run)
    monkeypatch.setattr(cell_module, "execute_run", interrupting)
    with pytest.raises(KeyboardInterrupt):
        run_cell(cell, tmp_path / "cut")
    resumed = run_cell(cell, tmp_path / "cut")
    assert [trial.candidate for trial in resumed.trials] == [trial.candidate for trial in whole.trials]
    assert resumed.best == whole.best
    assert resumed.note
    assert not whole.note


def test_a_cell_without_a_model_is_no_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*_: object, **__: object) -> Reply:
        raise BackendUnreachable("nothing listens")

    cell = make_cells(CASES, scaffolds("full"), 12, 1)[0]
    whole = run_cell(cell, tmp_path / "whole")
    with monkeypatch.context() as patched:
        patched.setattr(RulesBackend, "complete", silent)
        for _ in range(2):
            with pytest.raises(Outage, match="nothing listens"):
                run_cell(cell, tmp_path / "cut")
    assert finished(cell, tmp_path / "cut") is None
    resumed = run_cell(cell, tmp_path / "cut")
    assert [trial.candidate for trial in resumed.trials] == [trial.candidate for trial in whole.trials]
    assert (resumed.best, resumed.lost_calls) == (whole.best, 2)


def test_a_killed_process_costs_no_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    attempts: list[int] = []

    def pooled(cells, out, workers, keep_runs):
        attempts.append(len(cells))
        yield cells[0], run_cell(cells[0], out)
        if len(cells) > 1:
            raise BrokenProcessPool

    monkeypatch.setattr(many, "_pooled", pooled)
    cells = make_cells(CASES, scaffolds("random", "default"), 4, 1)
    assert [r.method for r in run_cells(cells, tmp_path, 2, quiet)] == ["random", "default"] * 2
    assert attempts == [4, 3, 2, 1]


def test_a_study_whose_processes_only_die_gives_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def pooled(cells, out, workers, keep_runs):
        raise BrokenProcessPool
        yield

    monkeypatch.setattr(many, "_pooled", pooled)
    with pytest.raises(BsaError, match="died 3 times"):
        run_cells(make_cells(CASES, scaffolds("random"), 4, 1), tmp_path, 2, quiet)


@pytest.mark.parametrize("keep", [False, True])
def test_journals_are_kept_only_on_demand(tmp_path: Path, keep: bool) -> None:
    cell = make_cells(CASES, scaffolds("random"), 4, 1)[0]
    run_cell(cell, tmp_path, keep_runs=keep)
    assert (cell.folder(tmp_path) / "journal.jsonl").is_file() is keep
    assert (cell.folder(tmp_path) / "cell.json").is_file()


def test_rounds_add_up(tmp_path: Path) -> None:
    found = run_cell(make_cells(CASES, scaffolds("cma-es"), 17, 1)[0], tmp_path)
    assert sum(entry.simulations for entry in found.rounds) == 16
    assert all(0 <= entry.proposer_s <= entry.round_s for entry in found.rounds)
    assert found.proposer_s == pytest.approx(sum(entry.proposer_s for entry in found.rounds))


def test_runtime_study(tmp_path: Path) -> None:
    rows = runtime_study(CASES[0], tmp_path, scaffolds("full", "cma-es"), steps=8, say=quiet)
    assert [row["simulations"] for row in rows] == [9, 9]
    assert rows[0]["llm_calls"] > 0
    assert all(row["last_steps_s"] > 0 for row in rows)
    assert "runtime.png" in {path.name for path in tmp_path.iterdir()}


def test_warm_up_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bsa.experiments.studies import warmup

    monkeypatch.setattr(warmup, "load_scaffold", toy_scaffold)
    rows = warmup_study(CASES, tmp_path, simulations=15, workers=1, say=quiet)
    assert {row["method"] for row in rows} == {"full+random-warm-up", "full+proposed-warm-up"}
    assert all(row["mape"] <= row["after_warm_up_mape"] for row in rows)
    assert with_warm_up(toy_scaffold(), "random").warm_up is not None


def test_recovery_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def reference(cell: object, experiment: object, candidate: dict[str, float], cache: object) -> ExperimentRun:
        return ExperimentRun(record(candidate))

    monkeypatch.setattr(recovery, "reference_run", reference)
    monkeypatch.setattr(recovery, "experiment_of", lambda case, charge, discharge: toy_task().experiments[0])
    summary = recovery_study(CASES, tmp_path, scaffolds("full"), simulations=40, workers=1, say=quiet)
    held = summary["held_out"]["full"]
    assert held["perfect"]["1C"] == 0.0
    assert held["recovered"]["1C"] < held["default"]["1C"]
    assert summary["within_case"]["full"]["cases"] == 2
    assert "Paper" in (tmp_path / "recovery.md").read_text()


def _trial(mape: float | None, **values: float) -> CellTrial:
    return CellTrial({**HIDDEN, **values}, mape, mape, "search", 0.1)


def test_within_case_correlations() -> None:
    trials = [_trial(9.0, **{SERIES: 0.3}), _trial(None), _trial(4.0, **{SERIES: 0.1}), _trial(1.0, **{SERIES: 0.05})]
    found = CellRecord("x", "c", "regular", "A", "1C/1C", "m", "finished", {}, {"mape": 1.0}, trials=trials)
    found = CellRecord(**{**vars(found), "best_candidate": trials[-1].candidate, "truth": dict(HIDDEN)})
    row = within_case(found, space())
    assert row["spearman"] == pytest.approx(1.0)
    assert row["monotonic"]
    assert row["incumbents"] == 3
    assert row["largest_relative_error"] == pytest.approx(0.05 / 0.03 - 1.0)


def _cell(method: str, mape: float, mode: str = "regular", parameter_set: str = "A") -> CellRecord:
    best = None if math.isnan(mape) else dict.fromkeys(REPORTED, mape)
    return CellRecord("x", f"{mode}-1", mode, parameter_set, "1C/1C", method, "finished", None, best)


def test_table_marks_best_and_second_and_counts_what_is_missing() -> None:
    records = [_cell("a", 3.0), _cell("a", 5.0), _cell("b", 1.0), _cell("c", 9.0), _cell("c", math.nan)]
    rows = rows_of(records)
    assert main_table(rows)["regular"]["a"]["A"].mean == 4.0
    table = markdown(rows, with_paper=False)
    assert "| b | **1.00** |" in table
    assert "<u>4.00±1.41</u>" in table
    assert "(1 without result)" in table


def test_statistics() -> None:
    found = statistic([1.0, 3.0, math.nan])
    assert (found.mean, found.worst, found.count, found.missing) == (2.0, 3.0, 2, 1)
    assert found.deviation == pytest.approx(np.std([1, 3], ddof=1))
    assert math.isnan(statistic([]).mean)


def test_the_papers_rows() -> None:
    rows = paper_rows("mape")
    assert rows["extreme"]["paper BO"]["Marquis2019"].mean == 8.42
    assert rows["regular"]["paper agent O3"]["Chen2020"].deviation == 24.5


def _not_again(*arguments: object, **keywords: object) -> None:
    raise AssertionError("a finished cell was run again")


class _Interrupting:
    """Stops the first run in its fifth simulation, as Ctrl-C does."""

    def __init__(self, execute: object) -> None:
        self._execute = execute
        self._first = True

    def __call__(self, task, config, folder, backend, resources, listener):
        if self._first:
            self._first = False
            listener = _Stopping(listener)
        return self._execute(task, config, folder, backend, resources, listener)


class _Stopping:
    def __init__(self, inner: object) -> None:
        self._inner = inner

    def proposed(self, proposal, phase, number) -> None:
        if number == 2:
            raise KeyboardInterrupt
        self._inner.proposed(proposal, phase, number)

    def tried(self, trial, best, usage) -> None:
        self._inner.tried(trial, best, usage)

    def counted(self, purpose: str, done: int, total: int) -> None:
        pass

    def noted(self, text: str) -> None:
        pass
