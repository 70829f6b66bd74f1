"""Studies on the toy cell: grids of a suite's cases, and analyses that are right in their arithmetic."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.files import write_csv
from bsa.core.scaffold import Scaffold
from bsa.core.simulation import ExperimentRun
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.experiments.campaign import task_sources
from bsa.experiments.campaign.grid_file import BackendChoice, SuiteFilter
from bsa.experiments.campaign.results import read_table
from bsa.experiments.campaign.running import plan_campaign, run_campaign
from bsa.experiments.campaign.summary import grouped, main_table, mean_of, paper_rows, statistic
from bsa.experiments.campaign.tables import tables
from bsa.experiments.studies import recovery
from bsa.experiments.studies.grids import study_grid
from bsa.experiments.studies.no_harm import no_harm_grid, summary, verdicts, write_no_harm
from bsa.experiments.studies.recovery import Recovered, recovery_table, within_case, write_recovery
from bsa.experiments.studies.runtime import write_runtime
from bsa.experiments.studies.warmup import STRATEGIES, warm_up_table, with_warm_up, write_warmup
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import CAPACITY, HIDDEN, SERIES, record, toy_scaffold, toy_task

from ..campaign.conftest import Here, Quiet

CASES = {
    case.key: case
    for case in (
        SuiteCase("regular", 1, "Chen2020", 1.0, 1.0, HIDDEN),
        SuiteCase("extreme", 2, "Ecker2015", 1.0, 2.0, {**HIDDEN, CAPACITY: 1.6}),
    )
}

RULES = BackendChoice(use="rules")
ALL = SuiteFilter(suite="generated")


@pytest.fixture(autouse=True)
def toy_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(case: SuiteCase, search: object = None) -> Task:
        return toy_task(case.hidden, case.key)

    monkeypatch.setattr(task_sources, "load_suite", lambda *arguments, **keywords: CASES)
    monkeypatch.setattr("bsa.experiments.suite.build.build_task", build)


def scaffolds(*names: str) -> list[Scaffold]:
    return [toy_scaffold(name) for name in names]


def ran(grid, folder: Path):
    """The rows of a study's grid and its store."""
    plan = plan_campaign(grid, folder / "store")
    rows, _ = run_campaign(plan, Here(), Quiet())
    assert {row["state"] for row in rows} == {"done"}
    return rows, plan


@pytest.mark.slow
def test_the_suite_has_its_tables_with_the_papers_rows(tmp_path: Path) -> None:
    grid = study_grid("suite", ALL, scaffolds("default", "random", "cma-es"), RULES, 12, paper_rows=True)
    rows, plan = ran(grid, tmp_path)
    assert [(row["task"], row["method"], row["simulations"]) for row in rows] == [
        (task, method, 1 if method == "default" else 12) for task in CASES for method in ("default", "random", "cma-es")
    ]
    assert all(row["early_objective"] >= row["objective"] * 0.9 for row in rows)
    written = {path.name: path for path in tables(plan.folder, plan.store.root)}
    table = written["tables.md"].read_text()
    assert "| paper agent O3 | 12.60 ± 24.50 |" in table
    assert "**" in table
    assert {"by-mode.svg", "convergence.svg", "tables.tex"} <= set(written)


def test_a_study_shares_its_cells_with_every_campaign_of_the_store(tmp_path: Path) -> None:
    ran(study_grid("suite", ALL, scaffolds("random"), RULES, 6), tmp_path)
    plan = plan_campaign(study_grid("recovery", ALL, scaffolds("random", "de"), RULES, 6), tmp_path / "store")
    found = [plan.store.result(cell.identity) is not None for cell in plan.cells]
    assert found == [True, False, True, False]


def test_a_base_cell_may_have_a_budget_of_its_own(tmp_path: Path) -> None:
    def simulations(**own: int) -> dict[str, int]:
        grid = study_grid("suite", ALL, scaffolds("random"), RULES, 6, own_budgets=own)
        return {cell.task.key: cell.config.simulations for cell in plan_campaign(grid, tmp_path).cells}

    assert simulations(Chen2020=3) == {"regular-1": 3, "extreme-2": 6}
    assert simulations(Chen2020=3, Ecker2015=4) == {"regular-1": 3, "extreme-2": 4}
    with pytest.raises(BsaError, match='did you mean "Chen2020"'):
        simulations(Chen2002=3)


def test_what_is_compared_has_its_whole_budget_and_a_fifth_of_it_for_the_warm_up(tmp_path: Path) -> None:
    (cell, _) = plan_campaign(study_grid("suite", ALL, scaffolds("full"), RULES, 25), tmp_path).cells
    config = cell.config
    assert (config.rounds, config.simulations, config.patience, config.warm_up) == (25, 25, 25, 5)


@pytest.mark.slow
def test_rounds_add_up_and_the_clock_is_read(tmp_path: Path) -> None:
    rows, plan = ran(study_grid("runtime", ALL, scaffolds("full", "cma-es"), RULES, 17), tmp_path)
    out = tmp_path / "out"
    timed = write_runtime([row for row in rows if row["task"] == "regular-1"], plan.store, out)
    assert [row["simulations"] for row in timed] == [17, 17]
    assert timed[0]["llm_calls"] > 0
    assert all(row["last_steps_s"] > row["last_proposals_s"] >= 0 for row in timed)
    assert {path.name for path in out.iterdir()} == {"runtime.csv", "runtime.md", "rounds.svg"}
    assert all(row["resumed"] == "" and row["proposer_s"] > 0 for row in rows)


def test_a_cell_that_was_taken_up_again_has_no_rounds_to_time(tmp_path: Path) -> None:
    grid = study_grid("runtime", ALL, scaffolds("random"), RULES, 12)
    rows, plan = ran(grid, tmp_path)
    folder = plan.store.cell(rows[0]["identity"])
    lines = (folder / "journal.jsonl").read_text().splitlines(keepends=True)
    (folder / "journal.jsonl").write_text("".join(lines[:5]))
    (folder / "result.json").unlink()
    again, _ = run_campaign(plan, Here(), Quiet())
    assert [row["resumed"] for row in again] == ["yes", ""]
    assert (again[0]["mape"], again[0]["simulations"]) == (rows[0]["mape"], rows[0]["simulations"])
    (row,) = write_runtime(again[:1], plan.store, tmp_path / "out")
    assert row["first_steps_s"] is None
    assert row["simulator_s"] > 0


@pytest.mark.slow
def test_warm_up_study(tmp_path: Path) -> None:
    both = [with_warm_up(toy_scaffold("full"), strategy) for strategy in STRATEGIES]
    rows, plan = ran(study_grid("warmup", ALL, both, RULES, 15), tmp_path)
    found = write_warmup(rows, plan.store, tmp_path / "out")
    assert {row["method"] for row in found} == {"full+random-warm-up", "full+proposed-warm-up"}
    assert all(row["mape"] <= row["after_warm_up_mape"] for row in found)
    assert "| proposed-warm-up |" in (tmp_path / "out" / "warmup.md").read_text()


def test_a_warm_up_without_a_result_of_a_case_has_a_dash_there() -> None:
    row = {"task": "a", "method": "full+random-warm-up", "mape": 1.5, "after_warm_up_mape": 3.0}
    table = warm_up_table([row, {**row, "task": "b"}, {**row, "method": "full+proposed-warm-up"}])
    assert table.splitlines()[-1] == "| proposed-warm-up | 3 | 1.5 | 1.5 | – |"


def test_what_was_recovered_is_told_where_no_cell_runs_at_another_rate() -> None:
    names = (
        "pearson",
        "spearman",
        "share_of_steps_that_co_decrease",
        "median_relative_error",
        "largest_relative_error",
    )
    table, remarks = recovery_table([dict.fromkeys(names, 0.5)], [])
    assert "recovered by the fit" in table
    assert [remark.split(",")[0] for remark in remarks] == [
        "* A parameter's own error: median 50.0% (of the cases' medians)",
        "* Within a case",
    ]


@pytest.mark.slow
def test_recovery_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def reference(cell: object, experiment: object, candidate: dict[str, float]) -> ExperimentRun:
        return ExperimentRun(record(candidate))

    monkeypatch.setattr(recovery, "reference_run", reference)
    monkeypatch.setattr(recovery, "experiment_of", lambda case: toy_task().experiments[0])
    rows, plan = ran(study_grid("recovery", ALL, scaffolds("full"), RULES, 40), tmp_path)
    write_recovery(rows, plan.store, tmp_path / "out", CASES, say=lambda line: None)
    held = grouped(read_table(tmp_path / "out" / "held_out.csv"), "quality", "rate")
    mean = {quality: mean_of(held[quality, 1.0], "mape") for quality in ("perfect", "recovered", "default")}
    assert mean["perfect"] == 0.0
    assert mean["recovered"] < mean["default"]
    text = (tmp_path / "out" / "recovery.md").read_text()
    assert "| parameters of 2 tasks, mean MAPE at | 0.2C | 1C | 2C |" in text
    assert "the paper reports" in text


def test_within_case_correlations(tmp_path: Path) -> None:
    rows, plan = ran(study_grid("recovery", ALL, scaffolds("default"), RULES, 1), tmp_path)
    known = recovery.read_run(plan.store.cell(rows[0]["identity"]))
    errors = [(9.0, 0.3), (None, 0.2), (4.0, 0.1), (1.0, 0.05)]
    trials = tuple(_trial(known.best, index, *pair) for index, pair in enumerate(errors))
    row = within_case(Recovered(rows[0], CASES["regular-1"], replace(known, trials=trials)))
    assert row["spearman"] == pytest.approx(1.0)
    assert row["monotonic"]
    assert row["incumbents"] == 3
    assert row["largest_relative_error"] == pytest.approx(0.05 / 0.03 - 1.0)


def _trial(like: Trial, index: int, mape: float | None, series: float) -> Trial:
    metrics = None if mape is None else replace(like.metrics, objective=mape, mape=mape)
    return replace(like, index=index, candidate={**HIDDEN, SERIES: series}, metrics=metrics)


@pytest.mark.slow
def test_bad_advice_does_no_harm(tmp_path: Path) -> None:
    grid = no_harm_grid(ALL, 12, alone=toy_scaffold("least-squares"), advised=toy_scaffold("hybrid"))
    rows, plan = ran(grid, tmp_path)
    out = tmp_path / "out"
    found = write_no_harm(rows, plan.store, out)
    assert [(verdict.task, verdict.adviser) for verdict in found] == [
        (task, adviser) for task in CASES for adviser in ("rules", "random-advice", "adversarial-advice")
    ]
    assert all(verdict.no_worse for verdict in found)
    assert {row["simulations"] <= 15 for row in rows if row["scaffold"] == "hybrid"} == {True}
    assert "| regular-1 |" in (out / "no_harm.md").read_text()
    read = read_table(out / "verdicts.csv")
    assert [row["task"] for row in read] == [verdict.task for verdict in found]


@pytest.mark.parametrize(
    ("alone", "advised", "no_worse", "score_no_worse"),
    [
        ((0.5, 0.5), (0.5, 0.54), True, True),
        ((0.0009, 0.0009), (0.001, 0.001), True, True),
        ((0.5, 0.5), (0.51, 0.56), False, False),
        ((None, None), (None, None), True, True),
        ((None, None), (3.0, 3.0), True, True),
        ((3.0, 3.0), (None, None), False, False),
    ],
)
def test_harm_is_called_harm(alone, advised, no_worse, score_no_worse) -> None:
    rows = [_row("least-squares", alone[1], "rules"), _row("hybrid", advised[1], "random-advice")]
    (verdict,) = verdicts(rows, {"least-squares": alone[0], "hybrid": advised[0]})
    assert verdict.adviser == "random-advice"
    assert (verdict.no_worse, verdict.score_no_worse) == (no_worse, score_no_worse)
    (entry,) = summary([verdict])
    assert entry["no_worse"] == int(no_worse)
    if not no_worse:
        assert entry["largest_harm_points"] == pytest.approx(math.inf if advised[0] is None else 0.01)


def _row(scaffold: str, score: float | None, backend: str):
    axes = {"task": "regular-1", "chemistry": "Chen2020", "rates": "1C/1C", "scaffold": scaffold, "backend": backend}
    return {**axes, "identity": scaffold, "state": "done", "mape": score}


def test_statistics() -> None:
    found = statistic([1.0, 3.0, math.nan, None])
    assert (found.mean, found.worst, found.count, found.missing) == (2.0, 3.0, 2, 2)
    assert found.deviation == pytest.approx(np.std([1, 3], ddof=1))
    assert math.isnan(statistic([]).mean)


def test_the_papers_rows() -> None:
    rows = paper_rows("mape")
    assert rows["extreme"]["paper BO"]["Marquis2019"].mean == 8.42
    assert rows["regular"]["paper agent O3"]["Chen2020"].deviation == 24.5


def test_a_table_comes_back_from_its_file(tmp_path: Path) -> None:
    rows = [{"mode": "regular", "method": "a", "chemistry": "A", "mape": value} for value in (3.0, 5.0, None, math.nan)]
    write_csv(tmp_path / "cells.csv", rows)
    entry = main_table(read_table(tmp_path / "cells.csv"))["regular"]["a"]["A"]
    assert (entry.mean, entry.missing) == (4.0, 2)
