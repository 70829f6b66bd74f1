"""Residuals for numerical fitting: smooth in the parameters, each in units of its tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .alignment import StepPair, pair_steps
from .simulation import ExperimentRun, Outcome
from .task import Experiment, Task
from .trajectory import FloatArray, StepKind

VOLTAGE_TOLERANCE_V = 1e-3
DURATION_TOLERANCE = 1e-3
CURRENT_TOLERANCE = 1e-2

_POINTS = 16
"""Points a step under a protocol."""

_DRIVEN_POINTS = 40
"""Points a step under a measured current, where steps are few and long."""

_DURATION_FLOOR_S = 5.0
"""Added to both durations, so that a vanishing step has a finite logarithm and a 1 s rest no weight."""


def residuals(task: Task, outcome: Outcome) -> FloatArray | None:
    """Step-aligned residuals of all experiments, one after the other.

    Under a protocol each step of the scored cycle gives voltage residuals (current residuals during a
    voltage hold) at equal fractions of its own duration, and one residual for the logarithm of its
    duration. Under a measured current the durations are given, and each step gives voltage residuals
    weighted by its share of time, so that the sum of squares is the mean squared voltage error times the
    number of points.

    Parameters
    ----------
    task : Task
        What is to be matched.
    outcome : Outcome
        What was simulated.

    Returns
    -------
    ndarray of shape (m,) or None
        The layout depends on the task alone; None if a simulation failed.
    """
    if not outcome.ok:
        return None
    parts: list[FloatArray] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        pairs = pair_steps(run.trajectory, experiment)
        if any(np.isnan(pair.fallback_v) for pair in pairs if pair.simulated is None):
            return None
        parts += _by_step(pairs, experiment)
    return np.concatenate(parts)


def partial_residuals(task: Task, outcome: Outcome) -> FloatArray | None:
    """Residuals of a simulation that failed: those of the steps that it finished, in every cycle.

    Unlike `residuals` they do not stop at the scored cycle, which a simulation that fails may never reach.

    Returns
    -------
    ndarray of shape (k,) or None
        The layout depends on the task alone; NaN for steps not finished. None if no step was.
    """
    parts: list[FloatArray] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        whole = replace(experiment, scored_cycle=None)
        pairs = pair_steps(run.trajectory, whole)
        reached = _finished(pairs, run)
        for place, part in enumerate(_by_step(pairs, whole)):
            parts.append(part if place < reached else np.full_like(part, np.nan))
    joined = np.concatenate(parts)
    return None if np.all(np.isnan(joined)) else joined


def _finished(pairs: list[StepPair], run: ExperimentRun) -> int:
    """How many of the record's steps a simulation has behind it: finished, or skipped before a finished one."""
    if run.failure is None:
        return len(pairs)
    behind = [place for place, pair in enumerate(pairs) if pair.simulated is not None]
    if behind and run.failure.unfinished and run.trajectory is not None:
        last = run.trajectory.steps[-1]
        cut = pairs[behind[-1]].simulated
        assert cut is not None
        # The step cut short counts only if the record has it: then it is the last of the pairs.
        if cut.time[-1] == run.trajectory.time[last.stop - 1]:
            behind.pop()
    return behind[-1] + 1 if behind else 0


def _by_step(pairs: list[StepPair], experiment: Experiment) -> list[FloatArray]:
    return _driven(pairs) if experiment.protocol is None else _protocol(pairs, experiment)


def _protocol(pairs: list[StepPair], experiment: Experiment) -> list[FloatArray]:
    peak = float(np.max(np.abs(experiment.target.current))) or 1.0
    fractions = np.linspace(0.0, 1.0, _POINTS)
    parts: list[FloatArray] = []
    for pair in pairs:
        if pair.step.kind is StepKind.CV_HOLD:
            measured, simulated = pair.current(fractions)
            tolerance = CURRENT_TOLERANCE * (np.abs(measured) + 0.1 * peak)
            curve = (simulated - measured) / tolerance
        else:
            measured, simulated = pair.voltage(fractions)
            # A rest of a second says what its neighbours say; let it not count 16 times.
            weight = min(1.0, pair.measured.duration / 60.0) ** 0.5
            curve = weight * (simulated - measured) / VOLTAGE_TOLERANCE_V
        measured_s, simulated_s = pair.duration_s
        ratio = np.log((simulated_s + _DURATION_FLOOR_S) / (measured_s + _DURATION_FLOOR_S))
        parts.append(np.append(curve, ratio / DURATION_TOLERANCE))
    return parts


def _driven(pairs: list[StepPair]) -> list[FloatArray]:
    total = sum(pair.measured.duration for pair in pairs) or 1.0
    count = _DRIVEN_POINTS * len(pairs)
    parts: list[FloatArray] = []
    for pair in pairs:
        # Midpoints: the ends of a step are where two records agree least about the clock.
        fractions = (np.arange(_DRIVEN_POINTS) + 0.5) / _DRIVEN_POINTS
        measured, simulated = pair.voltage(fractions)
        weight = np.sqrt(pair.measured.duration / total / _DRIVEN_POINTS * count)
        parts.append(weight * (simulated - measured) / VOLTAGE_TOLERANCE_V)
    return parts
