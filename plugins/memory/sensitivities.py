"""Learnt sensitivity rules: what the warm-up showed each parameter to do."""

from __future__ import annotations

import json

import numpy as np

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.proposal import Proposal
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
        names, changes, effects = self._regress(origin, good)
        failed = [self._describe(trial) for trial in self._warm_up if not trial.ok]
        content: dict[str, object] = {
            "meaning": "change of each feature when one parameter rises by its typical step",
            "learnt_from": f"{len(good)} warm-up simulations",
            "fit_quality_pct": 100.0 * self._explained(changes, effects, good, origin, names),
            "effects": {
                name: dict(zip(names, effects[:, place], strict=True)) for place, name in enumerate(self._space.names)
            },
        }
        if failed:
            content["made_the_simulation_fail"] = failed[:6]
        content = rounded(content, digits=3)
        while len(json.dumps(content)) > budget and content["effects"]:
            content["effects"] = {
                name: _without_smallest(rows)
                for name, rows in content["effects"].items()  # type: ignore[attr-defined]
                if len(rows) > 1
            }
        alike = {"move_the_features_alike": _alike(effects, self._space.names)}
        if alike["move_the_features_alike"] and len(json.dumps(content | alike)) <= budget:
            content |= alike
        return Recollection("Memory: learnt sensitivities", content, priority=3)

    def _regress(self, origin: Trial, good: list[Trial]) -> tuple[list[str], FloatArray, FloatArray]:
        names = list(_features(origin))
        changes = np.array([self._steps(origin, trial) for trial in good])
        responses = np.array(
            [[_features(trial).get(n, np.nan) - _features(origin)[n] for n in names] for trial in good]
        )
        responses = np.nan_to_num(responses)
        scale = float(np.trace(changes.T @ changes)) / len(self._space) or 1.0
        normal = changes.T @ changes + _RIDGE * scale * np.eye(len(self._space))
        return names, changes, np.linalg.solve(normal, changes.T @ responses).T

    def _steps(self, origin: Trial, trial: Trial) -> FloatArray:
        """Change of every parameter in typical steps, shape (p,)."""
        return np.array(
            [p.in_steps(trial.candidate[p.name]) - p.in_steps(origin.candidate[p.name]) for p in self._space]
        )

    def _explained(
        self, changes: FloatArray, effects: FloatArray, good: list[Trial], origin: Trial, names: list[str]
    ) -> float:
        """Share of the responses' variance that the linear rules explain, 0 to 1."""
        responses = np.array([[_features(trial).get(n, 0.0) - _features(origin)[n] for n in names] for trial in good])
        spread = np.sqrt(np.mean(responses**2, axis=0)) + 1e-12
        error = (responses - changes @ effects.T) / spread
        return float(max(0.0, 1.0 - np.mean(error**2)))

    def _describe(self, trial: Trial) -> str:
        changed = ", ".join(
            f"{parameter.name} {trial.candidate[parameter.name]:.4g}"
            for parameter in self._space
            if abs(parameter.in_steps(trial.candidate[parameter.name])) > 0.5
        )
        return f"{changed or 'a small change'}: {trial.failure.cause if trial.failure else 'nothing to compare'}"


def _features(trial: Trial) -> dict[str, float]:
    """What a trial's feedback says in numbers: its features, or its residuals where it has no others."""
    content = trial.feedback.content
    return dict(content.get("features") or content.get("residuals") or {})


def _alike(effects: FloatArray, names: tuple[str, ...]) -> list[list[str]]:
    """Pairs of parameters that do the same to all features, which no feedback can tell apart.

    Each feature counts by the size of its own strongest effect.
    """
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


def _without_smallest(effects: dict[str, float]) -> dict[str, float]:
    smallest = min(effects, key=lambda name: abs(effects[name]))
    return {name: value for name, value in effects.items() if name != smallest}
