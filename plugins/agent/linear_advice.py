"""What the measured effects predict if all acts linearly: the outcome of a change, the best change, a digest."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...core.inference.typical_steps import change_by
from ...core.parameters import Candidate
from ...core.prompt_sections import table
from ...core.proposal import apply_change
from ...core.sensitivities import linear_change
from ...core.trajectory import FloatArray
from ..feedback.rounding import rounded
from .situation import Situation

RADIUS = 4.0
"""Longest suggested change, in typical steps (Euclidean norm): beyond it a linear prediction means little."""

_SHRINK = 0.4
"""Longest next suggestion as a share of the length of a change that was no better."""

_WORST, _MATCHING = 3, 3
"""Features that a digest tells, the worst first, and parameters that it names for each."""

_NEGLIGIBLE = 0.02
"""Share of the largest suggested change, in typical steps, below which a parameter is left as it is."""

_CHANGE_DIGITS = 5
"""Digits of a suggested change: a tenth of a step, ``"*1.0096"``, is told to a hundredth of it."""


def predicted(situation: Situation, candidate: Candidate) -> dict[str, Any]:
    """Every feature now and after a change."""
    space, now = situation.task.space, situation.base.feedback.numbers
    steps = space.steps_between(situation.base.candidate, candidate)
    after = situation.sensitivities.predicted(now, dict(zip(space.names, map(float, steps), strict=True)))
    tolerances = situation.base.feedback.tolerances
    unknown = [n for n, s in zip(space.names, steps, strict=True) if s and n not in situation.sensitivities.effects]
    rows = [[name, now[name], value, tolerances.get(name)] for name, value in after.items()]
    return {
        "prediction": rounded(table(["feature", "now", "predicted", "tolerance"], rows)),
        **({"effects_not_measured": unknown} if unknown else {}),
    }


def suggested(situation: Situation) -> dict[str, str]:
    """The change that removes most of the mismatch if all acts linearly, as it is written; empty if none is known.

    It is shorter than changes from here that were no better.
    """
    radius = min([RADIUS, *(_SHRINK * length for length in situation.failed)])
    space, learnt = situation.task.space, situation.sensitivities
    features, mismatch, tolerance = _mismatch(situation)
    slopes = learnt.slopes(space.names, features)
    if not np.any(slopes):
        return {}
    known = np.any(slopes != 0.0, axis=0)
    lower, upper = (np.where(known, room, 0.0) for room in situation.room())
    steps = linear_change(slopes, mismatch, tolerance, lower, upper, radius)
    told = np.abs(steps) > _NEGLIGIBLE * max(np.max(np.abs(steps)), 1e-12)
    return {
        one.name: change_by(rise, one.typical_step, _CHANGE_DIGITS)
        for one, rise, counts in zip(space, steps, told, strict=True)
        if counts
    }


def as_factors(change: Mapping[str, str], base: Candidate) -> dict[str, str]:
    """The same change by factors alone, where values are positive: one notation, and no sign, to be copied.

    A model of 135 million parameters lost a sign of nine changes, or gave absolute values the asterisk of their
    neighbours.
    """
    factors = {name: apply_change(base[name], written) / (base[name] or -1.0) for name, written in change.items()}
    return {
        name: f"*{factors[name]:.{_CHANGE_DIGITS}g}" if base[name] > 0.0 and factors[name] > 0.0 else written
        for name, written in change.items()
    }


def digest(situation: Situation, change: Mapping[str, str]) -> dict[str, Any]:
    """The worst features, the parameters that match them best, and the suggested change: what a small model can use."""
    names = situation.task.space.names
    features, mismatch, tolerance = _mismatch(situation)
    slopes = situation.sensitivities.slopes(names, features)
    worst = np.argsort(-np.abs(mismatch / tolerance))[:_WORST]
    rows = []
    for place in worst:
        strongest = np.argsort(-np.abs(slopes[place]))[:_MATCHING]
        lowering = [f"{'raise' if slopes[place, p] * mismatch[place] < 0 else 'lower'} {names[p]}" for p in strongest]
        helpful = [words for words, p in zip(lowering, strongest, strict=True) if slopes[place, p]]
        rows.append([features[place], mismatch[place], mismatch[place] / tolerance[place], helpful])
    told = {"worst_features": table(["feature", "mismatch", "in_tolerances", "what_lowers_it_most"], rows)}
    return {**rounded(told, 3), **({"suggested_change": change} if change else {})}


def _mismatch(situation: Situation) -> tuple[list[str], FloatArray, FloatArray]:
    """Names, values and tolerances of the present features."""
    now: Mapping[str, float] = situation.base.feedback.numbers
    tolerances = situation.base.feedback.tolerances
    return list(now), np.array(list(now.values())), np.array([tolerances.get(name, 1.0) for name in now])
