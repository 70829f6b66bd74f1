"""A start that cannot be simulated: find a gentler cell that can, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.parameters import ParameterSpace
from ...core.task import Task
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from ...core.validation import read_yaml
from ..memory.priors import RULES_FILE

_STRIDES = (0.1, 0.25, 0.45, 0.7)
"""How far along the gentle direction, in units of the box."""

_SPREAD = 0.15
"""Standard deviation of the search around the point that got farthest."""

_HURTS, _HELPS = "raises", "lowers"


def gentle_direction(space: ParameterSpace) -> FloatArray:
    """Which way each parameter eases the cell, shape (p,): -1, 0 or 1 in the unit box.

    What raises polarisation is lowered and what lowers it is raised, by the rules of thumb that the
    priors show (smaller particles, higher porosity, lower Bruggeman exponents). Simulations fail above
    all where polarisation exhausts a concentration.
    """
    rules: list[dict[str, Any]] = read_yaml(RULES_FILE)
    direction = np.zeros(len(space))
    for place, name in enumerate(space.names):
        for rule in rules:
            if name.startswith(rule["parameter"]):
                direction[place] = float("polarisation" in rule[_HELPS]) - float("polarisation" in rule[_HURTS])
    return direction


def reached(task: Task, trial: Trial) -> float:
    """How far a trial got: the share of the records' time that it simulated, 0 to 1; 1 if it ran to its end."""
    if trial.ok:
        return 1.0
    wanted = sum(experiment.target.duration for experiment in task.experiments)
    got = sum(
        min(curve.duration, experiment.target.duration)
        for experiment, curve in zip(task.experiments, trial.curves, strict=True)
        if curve is not None
    )
    # A failed trial may outlast the record, being slower; it has failed all the same.
    return min(got / wanted, 0.999) if wanted > 0 else 0.0


class Feasibility:
    """Looks for a point that simulates, near the start: first along the gentle direction, then around.

    Parameters
    ----------
    task : Task
        What is to be simulated.
    start : Trial
        The trial that failed.
    seed : int
        For the search around.
    """

    def __init__(self, task: Task, start: Trial, seed: int) -> None:
        self._task = task
        self._space = task.space
        self._rng = np.random.default_rng(seed)
        self._gentle = gentle_direction(task.space)
        self._strides = list(_STRIDES) if np.any(self._gentle) else []
        self._farthest = start

    @property
    def guesses(self) -> bool:
        """Whether the rules of thumb are used up."""
        return not self._strides

    def ask(self) -> list[FloatArray]:
        """Two points to try next, in the unit box."""
        origin = self._space.to_unit(self._farthest.candidate)
        if self._strides:
            strides, self._strides = self._strides[:2], self._strides[2:]
            start = self._space.to_unit(self._space.initial)
            return [np.clip(start + stride * self._gentle, 0.0, 1.0) for stride in strides]
        # Half the steps lean towards the gentle side, for the rules are rules of thumb.
        steps = _SPREAD * self._rng.standard_normal((2, len(self._space)))
        steps[0] = np.where(self._gentle == 0.0, steps[0], np.abs(steps[0]) * self._gentle)
        return [np.clip(origin + step, 0.0, 1.0) for step in steps]

    def tell(self, trials: Sequence[Trial]) -> Trial | None:
        """Take in the trials; the one nearest the record, if any ran to its end."""
        good = [trial for trial in trials if trial.residuals is not None]
        if good:
            return min(good, key=lambda trial: _misfit(trial))
        self._farthest = max([self._farthest, *trials], key=lambda trial: reached(self._task, trial))
        return None


def _misfit(trial: Trial) -> float:
    return float("inf") if trial.residuals is None else float(trial.residuals @ trial.residuals)
