"""The residuals' derivatives at a candidate, from trials that a run has made anyway."""

from collections.abc import Sequence

import numpy as np

from ..parameters import Candidate, ParameterSpace
from ..trajectory import FloatArray
from ..trial import Trial

DIFFERENCE = 0.01
"""Finite-difference step as a share of each parameter's range, clear of the integrator's noise."""

_NEAR = 0.05
"""How far from the candidate, in units of the box, a measured derivative still stands for the one there."""

_SHORTEST, _LONGEST = 0.002, 0.05
"""Differences, as shares of the range, between which two trials tell a derivative: above noise, below curvature."""

_SAME = 1e-9


def known_derivatives(trials: Sequence[Trial], best: Trial, space: ParameterSpace) -> dict[int, FloatArray]:
    """Derivatives, shape (m,), by the parameter's place, from pairs of near trials that differ in a single parameter.

    Finite differences that a least-squares fit took are such pairs, so a fit that ended where it last
    looked around needs no further simulation. Of several pairs the one nearest the candidate counts.
    """
    centre = space.to_unit(best.candidate)
    points = [(space.to_unit(trial.candidate), trial.residuals) for trial in trials]
    seen = [(float(np.linalg.norm(point - centre)), point, found) for point, found in points if found is not None]
    near = [one for one in seen if one[0] <= _NEAR + _LONGEST]
    nearest: dict[int, float] = {}
    columns: dict[int, FloatArray] = {}
    for number, (away, here, first) in enumerate(near):
        for other, there, second in near[:number]:
            change, distance = here - there, min(away, other)
            moved = np.flatnonzero(np.abs(change) > _SAME)
            if len(moved) != 1 or not _SHORTEST <= abs(change[moved[0]]) <= _LONGEST:
                continue
            place = int(moved[0])
            if distance <= _NEAR and distance < nearest.get(place, np.inf):
                nearest[place] = distance
                columns[place] = (first - second) / change[place]
    return columns


def beside(space: ParameterSpace, candidate: Candidate, direction: FloatArray, length: float) -> FloatArray:
    """A point a step away along a direction, shape (p,), on the side with more room in the unit box."""
    centre = space.to_unit(candidate)
    choices = [np.clip(centre + side * length * direction, 0.0, 1.0) for side in (1.0, -1.0)]
    return max(choices, key=lambda point: float(np.linalg.norm(point - centre)))
