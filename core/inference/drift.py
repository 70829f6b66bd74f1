"""Parameters that drift over a life: fitted anew to each window, a cycle whose curves are kept, with their trend.

What is off in the first window is off in all of them, and no drift: windows are compared by what has changed since.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ..errors import BsaError
from ..normal import NORMAL_95
from ..parameters import Candidate, ParameterSpace
from ..trajectory import FloatArray
from .identifiability import effective_noise
from .refit import Refit, refit

Simulate = Callable[[int, Sequence[Candidate]], Sequence[FloatArray | None]]
"""The residuals of a window, by its cycle, for values of the drifting parameters; None where it failed."""

Quantities = Callable[[Candidate], Mapping[str, float]]
"""What is told of a window's values."""

_BUDGET = 30
"""Simulations of a window's fit at most: each is of one cycle."""

_NOISE_FLOOR = 2.0**0.5
"""Standard deviation of a change that is assumed at least, in tolerances: that of two residuals."""

_DIFFERENCE = 1e-3
"""Finite-difference step, in the fit's coordinates."""

_PER_CYCLES = 100.0
"""Cycles over which a trend is told."""


@dataclass(frozen=True)
class Drift:
    """One quantity over a life."""

    name: str
    cycles: tuple[int, ...]
    values: tuple[float, ...]
    half: tuple[float, ...]  # Half the 95 % interval of each.
    per_100_cycles: float  # Slope of the straight line through the values, weighed by their intervals.
    half_per_100_cycles: float  # Half its 95 % interval; scatter about the line counts.


def drifts(simulate: Simulate, cycles: Sequence[int], space: ParameterSpace, quantities: Quantities) -> list[Drift]:
    """Fit the windows one after the other, each from where the one before it ended.

    The windows are ``cycles``, of which the first one, at the initial values, is what the others are compared with;
    ``space`` is what drifts, and ``quantities`` what is told of a window's values. Raises `BsaError` if the first
    window cannot be simulated.
    """
    (first,) = simulate(cycles[0], [space.initial])
    if first is None:
        raise BsaError(
            f"the cell that fits the first cycle could not be simulated in cycle {cycles[0]} alone.",
            "see how well the first cycle is fitted.",
        )
    found: dict[int, Refit] = {}
    start = np.array([parameter.coordinate(parameter.initial) for parameter in space])
    for cycle in cycles[1:]:

        def changed(candidates: Sequence[Candidate], cycle: int = cycle) -> list[FloatArray | None]:
            return [None if one is None else (one - first) / _NOISE_FLOOR for one in simulate(cycle, candidates)]

        fit = refit(changed, space, start, budget=_BUDGET)
        if fit is not None:
            found[cycle], start = fit, fit.u
    told = {cycle: _told(fit, quantities) for cycle, fit in found.items()}
    names = list(quantities(space.initial))
    return [_drift(name, {cycle: row[name] for cycle, row in told.items()}) for name in names]


def _told(fit: Refit, quantities: Quantities) -> dict[str, tuple[float, float]]:
    """Each quantity with half its 95 % interval, propagated linearly."""
    noise = effective_noise(fit.residual, len(fit.u), 1.0)
    covariance = fit.covariance(noise**2)
    here = quantities(fit.candidate)
    slopes = []
    for step in _DIFFERENCE * np.eye(len(fit.u)):
        above, below = (quantities(fit.space.at(place)) for place in (fit.u + step, fit.u - step))
        slopes.append([(above[name] - below[name]) / (2 * _DIFFERENCE) for name in here])
    slope = np.array(slopes)
    half = NORMAL_95 * np.sqrt(np.einsum("ik,ij,jk->k", slope, covariance, slope))
    return {name: (here[name], float(half[k])) for k, name in enumerate(here)}


def _drift(name: str, rows: Mapping[int, tuple[float, float]]) -> Drift:
    cycles = np.array(list(rows), dtype=np.float64)
    values, half = (np.array([row[k] for row in rows.values()]) for k in (0, 1))
    slope, uncertain = float("nan"), float("nan")
    if len(cycles) > 2:
        deviation = np.maximum(half / NORMAL_95, 1e-12)
        line, covariance = np.polyfit(cycles / _PER_CYCLES, values, 1, w=1.0 / deviation, cov="unscaled")
        left = (values - np.polyval(line, cycles / _PER_CYCLES)) / deviation
        slope, freedom = float(line[0]), len(cycles) - 2
        scatter = np.sqrt(left @ left / freedom)  # about the line, in the values' own deviations
        # Few windows tell the scatter: Student's t. The values' own intervals are known: normal. The wider one counts.
        deviations = max(NORMAL_95, float(student.ppf(0.975, freedom) * scatter))
        uncertain = deviations * float(np.sqrt(covariance[0, 0]))
    return Drift(name, tuple(rows), tuple(map(float, values)), tuple(map(float, half)), slope, uncertain)
