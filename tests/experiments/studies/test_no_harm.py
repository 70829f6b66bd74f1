"""The no-harm study on the toy cell, and its verdicts on made-up records."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from bsa.core.task import Task
from bsa.experiments.studies import cell as cell_module
from bsa.experiments.studies.cell import CellRecord, CellTrial
from bsa.experiments.studies.no_harm import markdown, no_harm_study, summary, verdicts
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import CAPACITY, HIDDEN, toy_scaffold, toy_task

CASES = [
    SuiteCase("regular", 1, "Chen2020", 1.0, 1.0, HIDDEN),
    SuiteCase("extreme", 2, "Ecker2015", 1.0, 2.0, {**HIDDEN, CAPACITY: 1.6}),
]


def quiet(text: str) -> None:
    pass


def test_bad_advice_does_no_harm_and_the_study_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def build(case: SuiteCase, search: object = None, cache: Path | None = None) -> Task:
        return toy_task(case.hidden, case.key)

    monkeypatch.setattr(cell_module, "build_task", build)
    arguments = {"simulations": 12, "workers": 1, "say": quiet}
    scaffolds = {"alone": toy_scaffold("least-squares"), "advised": toy_scaffold("hybrid")}
    found = no_harm_study(CASES, tmp_path, **arguments, **scaffolds)
    assert [verdict.adviser for verdict in found] == ["rules", "random-advice", "adversarial-advice"] * 2
    assert all(verdict.no_worse for verdict in found)
    content = json.loads((tmp_path / "no_harm.json").read_text())
    assert (content["simulations"], content["hybrid_simulations"]) == (12, 15)
    assert content["adversarial-advice"]["no_worse"] == 2
    assert (tmp_path / "cells.csv").read_text().count("\n") == 9
    assert "| regular-1 |" in (tmp_path / "no_harm.md").read_text()

    def not_again(*arguments: object, **more: object) -> None:
        raise AssertionError("a finished cell was run again")

    monkeypatch.setattr(cell_module, "execute_run", not_again)
    assert no_harm_study(CASES, tmp_path, **arguments, **scaffolds) == found


def record(method: str, lowest: float | None, score: float | None) -> CellRecord:
    trials = [CellTrial({}, lowest, None, "initial", 0.1), CellTrial({}, None, None, "search", 0.1)]
    best = None if score is None else {"mape": score}
    return CellRecord("i", "regular-1", "regular", "Chen2020", "1C/1C", method, "finished", best=best, trials=trials)


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
def test_harm_is_called_harm(
    alone: tuple[float | None, float | None],
    advised: tuple[float | None, float | None],
    no_worse: bool,
    score_no_worse: bool,
) -> None:
    (verdict,) = verdicts([record("least-squares", *alone), record("hybrid-random-advice", *advised)])
    assert verdict.adviser == "random-advice"
    assert (verdict.no_worse, verdict.score_no_worse) == (no_worse, score_no_worse)
    entry = summary([verdict])["random-advice"]
    assert entry["no_worse"] == int(no_worse)
    if not no_worse and advised[0] is not None:
        assert entry["largest_harm_points"] == pytest.approx(0.01)
        assert "**worse**" in markdown([verdict], 100)
    if advised[0] is None and alone[0] is not None:
        assert math.isnan(verdict.advised)
