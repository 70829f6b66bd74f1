"""What the numerical fit has learnt, told in the words of the feedback: effects, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....core.appraisal import NOISE_FLOOR
from ....core.identifiability import effective_noise, identify
from ....core.parameters import Candidate, ParameterSpace
from ....core.trajectory import FloatArray
from ....core.trial import Trial

PER_RISE = float(np.log(1.1))
"""Effects are told for a rise by 10 %, as the warm-up's sensitivities are."""

_SAME = 1e-9


def effects(base: Trial, differences: Sequence[Trial], space: ParameterSpace) -> dict[str, dict[str, float]]:
    """Change of every feature when one parameter rises by 10 %, from trials that differ in one parameter.

    Parameters
    ----------
    base : Trial
        Where the differences start.
    differences : sequence of Trial
        Those of a finite-difference Jacobian.
    space : ParameterSpace
        The parameters.
    """
    found: dict[str, dict[str, float]] = {}
    before = _features(base)
    for trial in differences:
        changed = [name for name in space.names if _relative(trial, base, name) > _SAME]
        if len(changed) != 1 or not trial.ok:
            continue
        (name,) = changed
        old, new = base.candidate[name], trial.candidate[name]
        rise = float(np.log(new / old)) if old > 0 < new else (new - old) / (abs(old) or 1.0)
        after = _features(trial)
        found[name] = {
            feature: (after[feature] - value) / rise * PER_RISE for feature, value in before.items() if feature in after
        }
    return found


def open_questions(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, candidate: Candidate
) -> dict[str, Any]:
    """What the records cannot tell: parameters known only by their bounds, and those told only together."""
    found = identify(jacobian, residual, space, candidate, noise_floor=1.0)
    return {
        "not_determined_by_the_record": list(found.open),
        "only_together": [list(group) for group in found.correlated],
    }


def settled_questions(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, candidate: Candidate
) -> dict[str, list[str] | list[list[str]]]:
    """What the records say where the fit stands, in three short lists: fixed, open, and told only together."""
    noise = effective_noise(residual, len(space), NOISE_FLOOR)
    found = identify(jacobian, residual, space, candidate, noise=noise)
    return {
        "fixes": list(found.fixed),
        "leaves_open": list(found.open),
        "only_together": [list(group) for group in found.correlated],
    }


def _relative(trial: Trial, base: Trial, name: str) -> float:
    return abs(trial.candidate[name] - base.candidate[name]) / (abs(base.candidate[name]) or 1.0)


def _features(trial: Trial) -> Mapping[str, float]:
    content = trial.feedback.content
    numbers = content.get("features") or content.get("residuals") or {}
    return {name: value for name, value in numbers.items() if isinstance(value, (int, float))}
