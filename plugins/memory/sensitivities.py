"""What each parameter does to each feature, from every simulation so far: the warm-up's, and each of the search's."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.parameters import ParameterSpace
from ...core.prompt_sections import ALIKE, SENSITIVITIES
from ...core.proposal import Proposal
from ...core.sensitivities import Sensitivities
from ...core.trajectory import FloatArray
from ...core.trial import Trial, closest
from ..feedback.rounding import rounded

_RIDGE = 1e-6
"""Damping of the regression, relative: keeps it defined when there are fewer trials than parameters, and is too small
to weigh against a single far trial."""

_NEAR = 1.5
"""Changes made farther from here than this many typical steps say little about the slopes here."""

_ROUNDING = 0.02
"""Typical steps below which a difference between trials is lost in the rounding of the features."""

_MOVED = 1e-6
"""Typical steps below which a parameter has not been moved."""

_ALIKE = 0.95
"""Cosine between the effects of two parameters beyond which no feedback can tell them apart."""

_MOST_FAILURES = 4


@dataclass(frozen=True, eq=False)
class Secant:
    """Two trials, and what lies between them."""

    # trial, parent: The later one, and the nearest of those before it.
    trial: Trial
    parent: Trial

    def change(self, space: ParameterSpace) -> FloatArray:
        """In typical steps, shape (p,)."""
        return space.steps_between(self.parent.candidate, self.trial.candidate)

    def response(self, features: Sequence[str]) -> FloatArray:
        """Change of each feature, shape (f,); NaN where one of the two does not show it."""
        before, after = self.parent.feedback.numbers, self.trial.feedback.numbers
        return np.array([after.get(name, np.nan) - before.get(name, np.nan) for name in features])


@dataclass(frozen=True, eq=False)
class Slopes:
    """A regression of features on parameters around one trial."""

    # Change of each feature per typical step; NaN for parameters that no trial showing it moved. Shape (f, p).
    matrix: FloatArray
    # changes, responses: What it was fitted to. Shape (n, p) and (n, f).
    changes: FloatArray
    responses: FloatArray

    @property
    def points(self) -> list[int]:
        """How many trials moved each parameter."""
        return [int(count) for count in np.sum(np.abs(self.changes) > _MOVED, axis=0)]

    @property
    def misprediction_pct(self) -> FloatArray:
        """What the slopes leave unexplained of the trials that moved each parameter, in percent, shape (p,)."""
        seen = np.nan_to_num(self.responses)
        spread = np.sqrt(np.mean(seen**2, axis=0)) + 1e-12
        missed = np.where(np.isfinite(self.responses), seen - self.changes @ np.nan_to_num(self.matrix).T, 0.0)
        share = self.changes**2 / np.maximum(np.sum(self.changes**2, axis=1, keepdims=True), 1e-300)
        size = share.T @ np.sum((seen / spread) ** 2, axis=1)
        wrong = share.T @ np.sum((missed / spread) ** 2, axis=1)
        return np.asarray(100.0 * np.sqrt(wrong / np.maximum(size, 1e-12)))


class SensitivityMemory:
    """Regresses changes of the features on changes of the parameters, trial by trial, around the closest one.

    Algorithm 1, phase 1 of the paper has a model summarise the warm-up in words. Here the numbers are found by
    regression over secants, near ones counting most: every simulation of the search corrects them along its own
    direction, as Broyden's update does, and finite differences replace what was known of their parameters.
    """

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._space = context.task.space
        self._good: list[Trial] = []
        self._secants: list[Secant] = []
        self._failed: list[Trial] = []

    @hookimpl
    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        if trial.reduction is not None:
            return
        if not trial.ok:
            self._failed.append(trial)
            return
        if self._good:
            nearest = min(self._good, key=lambda other: self._distance(other, trial))
            if self._distance(nearest, trial) > _MOVED:
                self._secants.append(Secant(trial, nearest))
        self._good.append(trial)

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`."""
        if not self._secants:
            return None
        now = closest(self._good)
        features = list(now.feedback.numbers)
        slopes = self._slopes(self._secants, now, features)
        known = [
            {name: float(slope) for name, slope in zip(features, column, strict=True) if np.isfinite(slope)}
            for column in slopes.matrix.T
        ]
        effects = {name: rows for name, rows in zip(self._space.names, known, strict=True) if rows}
        learnt = Sensitivities(
            effects,
            f"{len(self._secants)} simulations, near ones most",
            rounded(self._remarks(features), digits=3),
            points=dict(zip(self._space.names, slopes.points, strict=True)),
            misprediction_pct={
                name: round(float(share), 1)
                for name, share in zip(self._space.names, slopes.misprediction_pct, strict=True)
            },
        )
        content = learnt.content(budget, features)
        # By one number nothing could be told apart.
        alike = {ALIKE: _alike(slopes.matrix, self._space.names) if len(features) > 1 else []}
        if alike[ALIKE] and len(json.dumps(content | alike)) <= budget:
            content |= alike
        return Recollection(SENSITIVITIES, content, priority=3)

    def _slopes(self, secants: Sequence[Secant], now: Trial, features: Sequence[str]) -> Slopes:
        changes = np.array([secant.change(self._space) for secant in secants])
        responses = np.array([secant.response(features) for secant in secants])
        weights = np.array([self._weight(secant, now) for secant in secants])
        matrix = np.array([_regressed(changes, response, weights) for response in responses.T])
        return Slopes(matrix.reshape(len(features), len(self._space)), changes, responses)

    def _weight(self, secant: Secant, now: Trial) -> float:
        """A secant tells a slope along its own direction, however long it is, of the place in its middle."""
        change = secant.change(self._space)
        off = self._space.steps_between(now.candidate, secant.parent.candidate) + 0.5 * change
        return float(1.0 / (change @ change + _ROUNDING**2) / (1.0 + (np.linalg.norm(off) / _NEAR) ** 4))

    def _distance(self, one: Trial, other: Trial) -> float:
        return float(np.linalg.norm(self._space.steps_between(one.candidate, other.candidate)))

    def _remarks(self, features: Sequence[str]) -> dict[str, Any]:
        remarks: dict[str, Any] = {}
        last = self._secants[-1]
        before = self._secants[:-1]
        alone = last.trial is self._good[-1] and all(
            (secant.trial.phase, secant.trial.round) != (last.trial.phase, last.trial.round) for secant in before
        )
        if last.trial.phase == "search" and before and alone:
            matrix = np.nan_to_num(self._slopes(before, last.parent, features).matrix)
            start = np.array([last.parent.feedback.numbers.get(name, np.nan) for name in features])
            expected = start + matrix @ last.change(self._space)
            # What it then was stands in the feedback, or with the latest attempt.
            remarks[f"predicted_of_trial_{last.trial.index}_in_the_order_of_the_feedback"] = expected.tolist()
        if self._failed:
            remarks["made_the_simulation_fail"] = [self._describe(trial) for trial in self._failed[-_MOST_FAILURES:]]
        return remarks

    def _describe(self, trial: Trial) -> str:
        changed = ", ".join(
            f"{parameter.name} {trial.candidate[parameter.name]:.4g}"
            for parameter in self._space
            if abs(parameter.in_steps(trial.candidate[parameter.name])) > 0.5
        )
        return f"{changed or 'a small change'}: {trial.failure.cause if trial.failure else 'nothing to compare'}"


def _regressed(changes: FloatArray, response: FloatArray, weights: FloatArray) -> FloatArray:
    """Change of one feature per typical step, shape (p,); NaN for parameters that no trial showing it moved."""
    shown = np.isfinite(response)
    moves, seen, weights = changes[shown], response[shown], weights[shown]
    moved = np.any(np.abs(moves) > _MOVED, axis=0)
    moves = moves[:, moved]
    slopes = np.full(changes.shape[1], np.nan)
    if np.any(moved):
        normal = (moves.T * weights) @ moves
        ridge = np.diag(_RIDGE * np.diag(normal))
        slopes[moved] = np.linalg.solve(normal + ridge, (moves.T * weights) @ seen)
    return slopes


def _alike(effects: FloatArray, names: tuple[str, ...]) -> list[list[str]]:
    """Groups of parameters that do the same to all features, which no feedback can tell apart.

    Each feature counts by the size of its own strongest effect, and nothing is said of effects that are NaN. Of a
    group each is like the first.
    """
    effects = np.nan_to_num(effects)
    strength = np.maximum(np.max(np.abs(effects), axis=1, keepdims=True), 1e-12)
    columns = effects / strength
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0, keepdims=True), 1e-12)
    alike = np.abs(columns.T @ columns) > _ALIKE
    groups: list[list[str]] = []
    taken: set[int] = set()
    for first in range(len(names)):
        group = [
            place
            for place in range(first, len(names))
            if place not in taken and (place == first or alike[first, place])
        ]
        if first not in taken and len(group) > 1:
            groups.append([names[place] for place in group])
            taken.update(group)
    return groups
