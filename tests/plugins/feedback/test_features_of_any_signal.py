"""Features are named after the task's signals; a swing is told by its amplitude and its delay."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.domain import Domain
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.signals import Signal
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, Trajectory
from bsa.plugins.feedback.features import mismatches

TIME = np.linspace(0.0, 10.0, 2001)
HEIGHT = Signal("height", "m", tolerance=1e-3, shown_unit="mm", shown_scale=1e3, oscillates=True)
WARMTH = Signal("warmth", "K", tolerance=0.1)


def features(task: Task, outcome: Outcome) -> dict[str, float]:
    return {name: found.value for name, found in mismatches(task, outcome).items()}


def record(size: float = 0.05, delay_s: float = 0.0, warmer: float = 0.0) -> Trajectory:
    height, warmth = size * np.sin(2.0 * np.pi * (TIME - delay_s)), 300.0 + 0.1 * TIME + warmer
    steps = (Step("swing", 0, len(TIME)),)
    return Trajectory(TIME, steps=steps, signals={"height": height, "warmth": warmth})


def task(*signals: Signal) -> Task:
    space = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0),))
    domain = Domain("pendulum", signals=signals)
    return Task("pendulum", CellModel("", "pendulum"), space, (Experiment("a", record()),), domain=domain)


def test_a_swing_that_is_larger_and_late_says_so() -> None:
    found = features(task(HEIGHT, WARMTH), Outcome((ExperimentRun(record(0.06, 0.01, 0.5)),)))
    assert len(found) == 3 * 3
    for part in ("early", "middle", "late"):
        assert found[f"swing_{part}_height_amplitude_shift_mm"] == pytest.approx(10.0, rel=0.02)
        assert found[f"swing_{part}_height_lag_s"] == pytest.approx(1.2 * 0.01, rel=0.05)
        assert found[f"swing_{part}_warmth_shift_k"] == pytest.approx(0.5)


def test_a_single_observed_signal_goes_without_saying() -> None:
    found = features(task(WARMTH), Outcome((ExperimentRun(record(warmer=0.5)),)))
    # A single step of a measured record is told in nine parts.
    parts = (2, 7, 15, 30, 50, 70, 85, 93, 98)
    assert set(found) == {f"swing_at_{percent}_pct_shift_k" for percent in parts}


def test_what_counts_as_a_mismatch_weighs_as_one_tolerance_in_the_misfit() -> None:
    found = mismatches(task(HEIGHT, WARMTH), Outcome((ExperimentRun(record()),)))
    assert found["swing_early_height_amplitude_shift_mm"].tolerance == pytest.approx(1.0)
    # A third of a step's sixteen points.
    assert found["swing_early_warmth_shift_k"].tolerance == pytest.approx(0.1 / (16 / 3) ** 0.5)
    steepness = 0.05 * 2.0 * np.pi / np.sqrt(2.0)
    assert found["swing_middle_height_lag_s"].tolerance == pytest.approx(1e-3 / steepness, rel=0.01)


def test_a_step_shorter_than_a_brief_one_is_left_out() -> None:
    brief = replace(task(WARMTH), domain=Domain("pendulum", signals=(WARMTH,), brief_s=60.0))
    assert features(brief, Outcome((ExperimentRun(record(warmer=0.5)),))) == {}
