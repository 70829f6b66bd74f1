"""Targets: made once, kept on disk, noisy only where asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.simulation import ExperimentRun, SimulationFailure
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.suite import target
from bsa.experiments.suite.build import build_task
from bsa.experiments.suite.case import SuiteCase
from bsa.experiments.suite.filters import passes

CASE = SuiteCase("regular", 0, "Chen2020", 1.0, 1.0, {"Separator thickness [m]": 2e-5})


def _record(capacity_ah: float, cycles: int = 2) -> Trajectory:
    """Cycles of a one-hour charge and discharge at a constant current."""
    pieces, steps = [], []
    for cycle in range(cycles):
        for place, sign in enumerate((-1.0, 1.0)):
            start = 3600.0 * (2 * cycle + place)
            pieces.append((np.linspace(start, start + 3600.0, 5), np.full(5, sign * capacity_ah)))
            kind = StepKind.CC_CHARGE if sign < 0 else StepKind.CC_DISCHARGE
            first = 5 * (2 * cycle + place)
            steps.append(Step(kind, first, first + 5, cycle + 1, position=place))
    time, current = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return Trajectory(time, current, 3.7 - 0.01 * current, None, tuple(steps))


@pytest.fixture
def solves(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[dict[str, float]]:
    """Stands in for PyBaMM: capacity falls with the separator's thickness; counts the calls."""
    asked: list[dict[str, float]] = []

    def solve(cell, experiment, candidate) -> ExperimentRun:
        asked.append(dict(candidate))
        thickness = candidate.get("Separator thickness [m]", 1.2e-5)
        if thickness > 1e-3:
            return ExperimentRun(None, SimulationFailure("too thick"))
        if thickness > 1e-4:
            return ExperimentRun(_record(3.0), SimulationFailure("stopped in cycle 2", "Hold at 4.2 V", 2, 9e3))
        return ExperimentRun(_record(5.0 - 1e4 * (thickness - 1.2e-5)))

    monkeypatch.setattr(target, "_solve", solve)
    monkeypatch.setenv("BSA_CACHE", str(tmp_path))
    return asked


def test_a_target_is_made_once(solves: list[dict[str, float]], tmp_path: Path) -> None:
    first = target.target_of(CASE)
    again = target.target_of(CASE)
    assert len(solves) == 1
    assert first.trajectory is not None
    assert again.trajectory is not None
    np.testing.assert_array_equal(first.trajectory.voltage, again.trajectory.voltage)
    target.target_of(replace(CASE, discharge_rate=2.0))
    target.target_of(replace(CASE, changes={"Separator thickness [m]": 3e-5}))
    assert len(solves) == 3


def test_a_target_of_other_code_is_made_again(
    solves: list[dict[str, float]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target.target_of(CASE)
    monkeypatch.setattr(target, "package_digest", lambda *rooms: "edited")
    target.target_of(CASE)
    assert len(solves) == 2


@pytest.mark.parametrize("content", ["{", "[]", "{}", '{"runs": [], "seconds": 1.0}', '{"runs": [3], "seconds": 1.0}'])
def test_a_damaged_cache_is_made_again(content: str, solves: list[dict[str, float]], tmp_path: Path) -> None:
    target.target_of(CASE)
    next(tmp_path.glob("targets/*.json")).write_text(content)
    target.target_of(CASE)
    assert len(solves) == 2


def test_noise_is_repeatable_and_leaves_rests_alone(solves: list[dict[str, float]], tmp_path: Path) -> None:
    noisy = replace(CASE, noise_v=1e-3)
    clean, one, two = (target.target_of(case).trajectory for case in (CASE, noisy, noisy))
    assert clean is not None
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.voltage, two.voltage)
    np.testing.assert_array_equal(one.current, clean.current)
    assert 0 < np.std(one.voltage - clean.voltage) < 5e-3
    # The same noise as ever: the second draw of the case's generator.
    rng = np.random.default_rng(list(CASE.key.encode()))
    rng.standard_normal(len(clean))
    np.testing.assert_array_equal(one.voltage, clean.voltage + 1e-3 * rng.standard_normal(len(clean)))
    assert len(solves) == 1


def test_filters(solves: list[dict[str, float]], tmp_path: Path) -> None:
    assert passes(replace(CASE, changes={"Separator thickness [m]": 5e-5}))
    assert not passes(replace(CASE, changes={"Separator thickness [m]": 1.3e-5}))
    assert not passes(replace(CASE, changes={"Separator thickness [m]": 2e-3}))
    assert not passes(replace(CASE, changes={}))


def test_the_task_hides_the_truth(solves: list[dict[str, float]], tmp_path: Path) -> None:
    task = build_task(CASE)
    assert task.name == "regular-0"
    assert len(task.space) == 9
    assert task.space.initial["Separator thickness [m]"] == pytest.approx(1.2e-5)
    assert task.experiments[0].scored_cycle == 2
    assert task.cell.overrides == {}
    assert task.notes == ()


def test_a_target_that_stops_early_is_said_and_scored(solves: list[dict[str, float]], tmp_path: Path) -> None:
    task = build_task(replace(CASE, changes={"Separator thickness [m]": 2e-4}))
    assert "Hold at 4.2 V" in task.notes[0]
    with pytest.raises(BsaError, match="cannot simulate the true cell"):
        build_task(replace(CASE, changes={"Separator thickness [m]": 2e-3}))


def test_known_ambient_temperature_is_not_hidden() -> None:
    warm = replace(CASE, changes={"Ambient temperature [K]": 318.15, "Separator thickness [m]": 2e-5})
    assert warm.temperature_k == pytest.approx(318.15)
    assert list(warm.hidden) == ["Separator thickness [m]"]
    assert target.experiment_of(warm).temperature_k == pytest.approx(318.15)
