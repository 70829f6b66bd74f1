"""What the numerical fit has learnt, told in the words of the feedback: effects, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....core.identifiability import effective_noise, identify
from ....core.parameters import Candidate, ParameterSpace
from ....core.post_fit_analysis import NOISE_FLOOR
from ....core.trajectory import FloatArray
from ....core.trial import Trial

_SAME = 1e-9
"""Typical steps below which a parameter has not been moved."""


def effects(base: Trial, differences: Sequence[Trial], space: ParameterSpace) -> dict[str, dict[str, float]]:
    """Change of every feature when one parameter rises by its typical step, from trials that differ in one parameter.

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
    before = base.feedback.numbers
    for trial in differences:
        rises = space.steps_between(base.candidate, trial.candidate)
        (moved,) = np.nonzero(np.abs(rises) > _SAME)
        if len(moved) != 1 or not trial.ok:
            continue
        after = trial.feedback.numbers
        found[space.names[moved[0]]] = {
            feature: (after[feature] - value) / float(rises[moved[0]])
            for feature, value in before.items()
            if feature in after
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
