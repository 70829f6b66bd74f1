"""A start that cannot be simulated: find a gentler cell that can, before anything is fitted.

First what is gentle by rule, since it is cheap and mostly works; then continuations over easier tasks; then guesses
around the trial that got farthest.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.comparison.alignment import pair_steps
from ...core.rms import rms
from ...core.task import Task
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .continuation import Continuation, CurrentRateContinuation, FirstCycleContinuation, Reductions
from .trial_errors import sum_of_squares

_STRIDES = (0.1, 0.25, 0.45, 0.7)
"""Distances along the gentle direction that are tried, in units of the box."""

_SPREAD = 0.15
"""Standard deviation of the search around the point that got farthest."""

_NO_LIMIT = 10**6

_TOO_LONG, _SHORT_S = 1.2, 60.0
"""A step is too long from this many times its measured duration, which counts as a minute at least."""

_HURTS, _HELPS = "raises", "lowers"


def gentle_direction(task: Task) -> FloatArray:
    """Direction of each parameter towards less polarisation, shape (p,): -1, 0 or 1 in the unit box.

    What raises polarisation is lowered and what lowers it is raised, by the rules of thumb that the
    priors show (smaller particles, higher porosity, lower Bruggeman exponents). Simulations fail above
    all where polarisation exhausts a concentration.
    """
    direction = np.zeros(len(task.space))
    for place, rule in _rules(task):
        direction[place] = float("polarisation" in rule[_HELPS]) - float("polarisation" in rule[_HURTS])
    return direction


def smaller_direction(task: Task) -> FloatArray:
    """Direction of the parameters that only lower the capacity, shape (p,): -1, or 0 for all others."""
    direction = np.zeros(len(task.space))
    for place, rule in _rules(task):
        if "discharge_time" in rule[_HURTS] and "polarisation" not in (*rule[_HELPS], *rule[_HURTS]):
            direction[place] = -1.0
    return direction


def _rules(task: Task) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """The rules of thumb for the searched parameters, each behind the place of its parameter."""
    for place, name in enumerate(task.space.names):
        yield from ((place, rule) for rule in task.domain.rules if rule["parameter"] in name)


def outlasts(task: Task, trial: Trial) -> bool:
    """Whether a trial stopped in a step that had taken longer than the measured one: the cell is too large."""
    if trial.failure is None or not trial.failure.unfinished:
        return False
    for experiment, curve in zip(task.experiments, trial.curves, strict=True):
        pairs = [pair for pair in pair_steps(curve, replace(experiment, scored_cycle=None)) if pair.simulated]
        if pairs and curve is not None and curve.steps[-1].kind is pairs[-1].step.kind:
            measured_s, simulated_s = pairs[-1].duration_s
            if simulated_s > _TOO_LONG * max(measured_s, _SHORT_S):
                return True
    return False


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


def progress(task: Task, trial: Trial) -> tuple[float, float]:
    """An order of failed trials: how far they got, to a hundredth, then how well what they finished matches."""
    share = round(reached(task, trial), 2)
    finished = None if trial.partial is None else trial.partial[np.isfinite(trial.partial)]
    misfit = rms(finished) if finished is not None and finished.size else float("inf")
    return share, -misfit


class Feasibility:
    """Looks for a point that simulates, near the start: along the gentle direction, by continuations, then around."""

    def __init__(self, task: Task, start: Trial, seed: int) -> None:
        self._task = task
        self._space = task.space
        self._rng = np.random.default_rng(seed)
        self._too_large = too_large = bool(task.domain.drives) and outlasts(task, start)
        self._gentle = smaller_direction(task) if too_large else gentle_direction(task)
        self._strides = list(_STRIDES) if np.any(self._gentle) else []
        self._farthest = start
        # Lower currents do not empty a cell that is too large any sooner.
        self._continuations = (["shortened"] if too_large else ["shortened", "slowed"]) if can_be_reduced(task) else []
        self._continuation: Continuation | None = None
        self.reductions: Reductions = ()
        """How the task is reduced for each of the points just asked for; empty where it is not."""

    @property
    def words(self) -> str:
        """What is being tried, in a sentence."""
        if self._continuation is not None:
            return self._continuation.words
        if self._too_large:
            return "The cell holds more charge than its steps have time for: a smaller one first."
        return "Nothing near the start could be simulated yet: looking for gentler values that can."

    def ask(self) -> list[FloatArray]:
        """The points to try next, in the unit box."""
        self.reductions = ()
        if self._strides:
            strides, self._strides = self._strides[:2], self._strides[2:]
            start = self._space.to_unit(self._space.initial)
            return [np.clip(start + stride * self._gentle, 0.0, 1.0) for stride in strides]
        points = self._by_continuation()
        if points:
            return points
        origin = self._space.to_unit(self._farthest.candidate)
        # One of the two steps is towards the gentle side only, the other free: the rules are rules of thumb.
        steps = _SPREAD * self._rng.standard_normal((2, len(self._space)))
        steps[0] = np.where(self._gentle == 0.0, steps[0], np.abs(steps[0]) * self._gentle)
        return [np.clip(origin + step, 0.0, 1.0) for step in steps]

    def _by_continuation(self) -> list[FloatArray]:
        """What a continuation asks for, the next one where the last has led nowhere."""
        while self._continuation is not None or self._continuations:
            if self._continuation is None:
                self._continuation = self._begin(self._continuations.pop(0))
                continue
            candidates = self._continuation.ask(_NO_LIMIT)
            if candidates:
                self.reductions = self._continuation.reductions
                return [self._space.to_unit(candidate) for candidate in candidates]
            self._continuation = None
        return []

    def _begin(self, kind: str) -> Continuation | None:
        failure = self._farthest.failure
        if kind == "slowed":
            return CurrentRateContinuation(self._space, self._space.to_unit(self._space.initial), self._gentle)
        if failure is None or failure.cycle < 2:
            return None
        return FirstCycleContinuation(self._space, self._space.to_unit(self._farthest.candidate), failure.cycle - 1)

    def tell(self, trials: Sequence[Trial]) -> Trial | None:
        """Take in the trials; the one nearest the record, if any ran to its end."""
        if self.reductions and self._continuation is not None:
            self._continuation.tell(trials)
            if self._continuation.over:
                self._continuation = None
        good = [trial for trial in trials if trial.residuals is not None]
        if good:
            return min(good, key=sum_of_squares)
        whole = [trial for trial in trials if trial.reduction is None]
        self._farthest = max([self._farthest, *whole], key=lambda trial: progress(self._task, trial))
        return None


def can_be_reduced(task: Task) -> bool:
    """Whether a protocol, which may be reduced, drives every record; a measured current has no cut-offs."""
    return bool(task.domain.drives) and all(experiment.protocol is not None for experiment in task.experiments)
