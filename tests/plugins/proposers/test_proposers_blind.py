"""Blind proposers: they stay inside their budget and bounds, get better, and resume exactly."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.extras import require
from bsa.core.run.journal import FILE_NAME
from bsa.core.run.loop import RunResult
from bsa_toy_cell import SERIES, toy_scaffold, toy_task

RunToy = Callable[..., RunResult]

needs_ax = pytest.mark.skipif(find_spec("ax") is None, reason="needs the extra bo")
FAST = ["random", "cma-es", "de", "weighted-de"]
SLOW = [pytest.param(name, marks=[needs_ax, pytest.mark.slow]) for name in ("bo", "qnehvi")]
BUDGET = {"warm_up": 0, "patience": 100}


@pytest.fixture(autouse=True)
def _quick_acquisitions(request: pytest.FixtureRequest) -> None:
    """Slow samplers have Ax's own settings in one test."""
    callspec = getattr(request.node, "callspec", None)
    if callspec is not None and callspec.params.get("name") in ("bo", "qnehvi"):
        quality = request.function is test_budget_bounds_and_progress
        request.getfixturevalue("without_compiler" if quality else "few_draws")


def simulations(name: str, of_fast_ones: int) -> int:
    """Of a slow sampler, whose steps take seconds, three after its eight Sobol points."""
    return of_fast_ones if name in FAST else 11


def tried(result: RunResult) -> list[dict[str, float]]:
    return [dict(trial.candidate) for trial in result.trials]


def fragile(name: str) -> object:
    return toy_scaffold(name, simulator={"use": "toy-cell", "options": {"breaks_above_ohm": 0.1}})


@pytest.mark.parametrize("name", FAST + SLOW)
def test_budget_bounds_and_progress(name: str, run_toy: RunToy) -> None:
    count = simulations(name, 24)
    result = run_toy(scaffold=toy_scaffold(name), rounds=40, simulations=count, **BUDGET)
    assert len(result.trials) == count
    for candidate in tried(result):
        assert toy_task().space.project(candidate) == candidate
    assert result.lowest.objective < result.trials[0].objective


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST + SLOW)
def test_same_seed_same_candidates_other_seed_others(name: str, run_toy: RunToy, tmp_path: Path) -> None:
    def run(folder: str, seed: int) -> list[dict[str, float]]:
        count = simulations(name, 14)
        return tried(run_toy(tmp_path / folder, toy_scaffold(name), rounds=40, simulations=count, seed=seed, **BUDGET))

    first = run("a", 1)
    np.random.seed(99)  # a proposer that used numpy's global numbers would now differ
    assert run("b", 1) == first
    assert run("c", 2) != first


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST + SLOW)
def test_resumes_exactly_after_any_trial(name: str, run_toy: RunToy, tmp_path: Path) -> None:
    settings = {"rounds": 40, "simulations": simulations(name, 13), **BUDGET}
    whole = tried(run_toy(tmp_path / "whole", toy_scaffold(name), **settings))
    lines = (tmp_path / "whole" / FILE_NAME).read_bytes().splitlines(keepends=True)
    kept_counts = range(1, len(lines), 4) if name in FAST else [len(lines) // 2]
    for kept in kept_counts:
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]))
        assert tried(run_toy(folder, toy_scaffold(name), **settings)) == whole


@pytest.mark.parametrize("name", FAST + SLOW)
def test_failed_simulations_steer_and_never_stop(name: str, run_toy: RunToy) -> None:
    count = simulations(name, 24)
    result = run_toy(scaffold=fragile(name), rounds=40, simulations=count, **BUDGET)
    assert len(result.trials) == count
    assert any(not trial.ok for trial in result.trials)
    assert result.best.ok
    assert result.best.candidate[SERIES] <= 0.1


@pytest.mark.slow
@pytest.mark.parametrize("broken", [False, True])
@pytest.mark.parametrize("name", FAST + SLOW)
def test_simulations_alone_end_a_sampler(name: str, broken: bool, run_toy: RunToy) -> None:
    """Neither few rounds, nor little patience, nor a population that has failed as one stops it early."""
    options = {"breaks_above_ohm": 1e-3 if broken else 1.0}
    scaffold = toy_scaffold(name, simulator={"use": "toy-cell", "options": options})
    count = simulations(name, 60)
    result = run_toy(scaffold=scaffold, rounds=1, patience=1, warm_up=0, simulations=count)
    assert len(result.trials) == count
    assert result.status == "simulations-spent"
    assert any(trial.ok for trial in result.trials) != broken


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cma-es", "de"])
def test_populations_converge(name: str, run_toy: RunToy) -> None:
    result = run_toy(scaffold=toy_scaffold(name), rounds=60, simulations=200, **BUDGET)
    assert result.lowest.objective < 0.1 * result.trials[0].objective


@pytest.mark.slow
def test_cma_population_is_the_papers(run_toy: RunToy) -> None:
    result = run_toy(scaffold=toy_scaffold("cma-es"), simulations=50, **BUDGET)
    assert {trial.round for trial in result.trials if trial.index in range(1, 6)} == {1}
    assert result.trials[6].round == 2
    assert len(toy_task().space) + 1 == 5


def test_default_tries_nothing(run_toy: RunToy) -> None:
    result = run_toy(scaffold=toy_scaffold("default"))
    assert len(result.trials) == 1
    assert result.status == "finished"


@needs_ax
@pytest.mark.slow
@pytest.mark.usefixtures("few_draws")
def test_sobol_comes_first_and_does_not_repeat(run_toy: RunToy) -> None:
    result = run_toy(scaffold=toy_scaffold("bo"), rounds=40, simulations=12, **BUDGET)
    assert [trial.round for trial in result.trials] == [0, *[1] * 8, 2, 3, 4]
    space = toy_task().space
    positions = np.array([space.to_unit(trial.candidate) for trial in result.trials])
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=2) + np.eye(len(positions))
    assert distances.min() > 1e-6


def test_missing_extra_names_the_line_to_type(monkeypatch: pytest.MonkeyPatch, run_toy: RunToy) -> None:
    for module in [name for name in sys.modules if name == "ax" or name.startswith("ax.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(sys, "meta_path", [_Hidden("ax"), *sys.meta_path])
    with pytest.raises(BsaError) as caught:
        run_toy(scaffold=toy_scaffold("bo"))
    assert "ax" in caught.value.message
    assert caught.value.hint == 'pip install "battery-sim-agent[bo]"'


def test_a_broken_library_is_not_called_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "bsa_broken_library.py").write_text("import bsa_surely_not_there\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="bsa_surely_not_there"):
        require("bsa_broken_library", "bo", "a test")


class _Hidden:
    """Makes one distribution look as if it were not installed."""

    def __init__(self, name: str) -> None:
        self._name = name

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.split(".")[0] == self._name:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
