"""Learnt sensitivity rules: what the warm-up showed each parameter to do."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.prompt_sections import SENSITIVITIES
from ...core.proposal import Proposal
from ...core.sensitivities import Sensitivities
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from ..feedback.rounding import rounded

_RIDGE = 1e-3
"""Damping of the regression, relative: keeps it defined when there are fewer trials than parameters."""

_ALIKE = 0.95
"""Cosine between the effects of two parameters beyond which no feedback can tell them apart."""


class SensitivityMemory:
    """Regresses the change of every feature on the change of every parameter over the warm-up.

    Algorithm 1, phase 1 of the paper has a model summarise the warm-up in words. Here the numbers are
    found by linear regression, which any reader, model or rule, can turn into words without loss.
    """

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._space = context.task.space
        self._initial: Trial | None = None
        self._warm_up: list[Trial] = []

    @hookimpl
    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        if trial.phase == "initial":
            self._initial = trial
        elif trial.phase == "warm-up":
            self._warm_up.append(trial)

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`."""
        good = [trial for trial in self._warm_up if trial.ok]
        origin = self._initial if self._initial is not None and self._initial.ok else (good[0] if good else None)
        if origin is None or len(good) < 2:
            return None
        features = list(origin.feedback.numbers)
        changes = np.array([self._space.steps_between(origin.candidate, trial.candidate) for trial in good])
        responses = np.array([_responses(origin, trial, features) for trial in good])
        slopes = np.array([self._slopes(changes, response) for response in responses.T]).reshape(-1, len(self._space))
        remarks: dict[str, Any] = {"fit_quality_pct": 100.0 * _explained(changes, responses, slopes)}
        failed = [self._describe(trial) for trial in self._warm_up if not trial.ok]
        if failed:
            remarks["made_the_simulation_fail"] = failed[:6]
        effects = {
            name: {feature: float(slope) for feature, slope in zip(features, column, strict=True) if np.isfinite(slope)}
            for name, column in zip(self._space.names, slopes.T, strict=True)
        }
        learnt = Sensitivities(effects, f"{len(good)} warm-up simulations", rounded(remarks, digits=3))
        content = learnt.content(budget)
        alike = {"move_the_features_alike": _alike(slopes, self._space.names)}
        if alike["move_the_features_alike"] and len(json.dumps(content | alike)) <= budget:
            content |= alike
        return Recollection(SENSITIVITIES, content, priority=3)

    def _slopes(self, changes: FloatArray, response: FloatArray) -> FloatArray:
        """Change of one feature per typical step, shape (p,); NaN for parameters that no trial showing it moved."""
        shown = np.isfinite(response)
        moves, response = changes[shown], response[shown]
        moved = np.any(moves != 0.0, axis=0)
        moves = moves[:, moved]
        slopes = np.full(len(self._space), np.nan)
        if np.any(moved):
            damping = _RIDGE * float(np.sum(moves**2)) / moves.shape[1]
            slopes[moved] = np.linalg.solve(moves.T @ moves + damping * np.eye(moves.shape[1]), moves.T @ response)
        return slopes

    def _describe(self, trial: Trial) -> str:
        changed = ", ".join(
            f"{parameter.name} {trial.candidate[parameter.name]:.4g}"
            for parameter in self._space
            if abs(parameter.in_steps(trial.candidate[parameter.name])) > 0.5
        )
        return f"{changed or 'a small change'}: {trial.failure.cause if trial.failure else 'nothing to compare'}"


def _responses(origin: Trial, trial: Trial, features: Sequence[str]) -> FloatArray:
    """Change of each feature from the origin, shape (f,); NaN where the trial does not show it."""
    before, after = origin.feedback.numbers, trial.feedback.numbers
    return np.array([after.get(feature, np.nan) - before[feature] for feature in features])


def _explained(changes: FloatArray, responses: FloatArray, slopes: FloatArray) -> float:
    """Share of the responses' variance that the slopes explain, 0 to 1."""
    shown = np.isfinite(responses)
    seen = np.where(shown, responses, 0.0)
    spread = np.sqrt(np.mean(seen**2, axis=0)) + 1e-12
    error = np.where(shown, seen - changes @ np.nan_to_num(slopes).T, 0.0) / spread
    return float(max(0.0, 1.0 - np.mean(error**2))) if error.size else 0.0


def _alike(effects: FloatArray, names: tuple[str, ...]) -> list[list[str]]:
    """Pairs of parameters that do the same to all features, which no feedback can tell apart.

    Each feature counts by the size of its own strongest effect, and nothing is said of effects that are NaN.
    """
    effects = np.nan_to_num(effects)
    strength = np.maximum(np.max(np.abs(effects), axis=1, keepdims=True), 1e-12)
    columns = effects / strength
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0, keepdims=True), 1e-12)
    cosines = np.abs(columns.T @ columns)
    return [
        [names[first], names[second]]
        for first in range(len(names))
        for second in range(first + 1, len(names))
        if cosines[first, second] > _ALIKE
    ]
