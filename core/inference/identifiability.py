"""What the records fix, and what they leave open: from the residuals' derivatives at the optimum.

A good fit is no proof of good parameters: combinations of them may cancel in everything that was
measured. The singular values of the Jacobian tell which.

References
----------
Bates & Watts, Nonlinear Regression Analysis and Its Applications (1988), Ch. 2 (linear approximation
intervals). Nocedal & Wright, Numerical Optimization, 2nd ed. (2006), Ch. 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.stats import t as student

from ..bounded_step import bounded_step
from ..normal import NORMAL_95
from ..parameters import Candidate, ParameterSpace
from ..rms import rms
from ..trajectory import FloatArray

Verdict = Literal["fixed", "loose", "open"]

_BOX_VARIANCE = 1.0 / 12.0
"""Variance of an even distribution over a bounded range: what the bounds alone say of a parameter."""

_FIXED, _LOOSE = 0.05, 0.25
"""Half-width of an interval, as a share of the searched range, up to which a parameter is fixed or loose."""

DRAWS_KEPT, DRAWS_OF_A_LIFE = 20, 8
"""Draws that a prediction is simulated at, which tell its standard deviation to a sixth; of a life, where each takes
minutes, to a quarter."""

_CORRELATED = 0.9
"""Correlation of two estimates above which their parameters stand in one group."""

_NAMED_WEIGHT = 0.2
"""Weight in a combination, whose length is 1, from which a parameter is named in it."""

_CONFIDENCE = 0.95
"""Probability of an interval."""

_BEYOND_NOISE, _FOLLOWS_THE_CURVE = 3.0, 0.5
"""Root mean square, in tolerances, and correlation of neighbours, above which residuals are no instrument's noise."""

_OF_A_SERIES = 0.25
"""Share of the residuals that parameters are taken to follow at most: the bias is the first term of a series."""

_MOST_ALIKE = 0.98
"""Correlation of neighbours beyond which it cannot be told from a constant offset (factor 10)."""


@dataclass(frozen=True)
class Interval:
    """One parameter's 95 % interval."""

    # value, lower, upper: The fitted value and the interval's ends in the parameter's unit, cut at the bounds.
    value: float
    lower: float
    upper: float
    # Half the interval's width as a share of the searched range, on the parameter's own scale. Of a linear interval it
    # is that before the ends are cut, and may exceed 0.5; of a sample, which lies within the bounds, that of the ends.
    share_of_range: float
    verdict: Verdict  # What that share amounts to.


@dataclass(frozen=True)
class Combination:
    """A direction of the unit box that the records see as one thing."""

    weights: Mapping[str, float]  # The parameters that take part, with sign, the largest first.
    # Change of the residuals, in tolerances and weighed by their deviations, per unit of the box along it.
    singular_value: float
    share_of_range: float  # Half the width of its 95 % interval.
    verdict: Verdict  # As for a parameter.


@dataclass(frozen=True)
class Identifiability:
    """What a fit determines."""

    intervals: Mapping[str, Interval]  # By parameter.
    combinations: tuple[Combination, ...]  # Best determined first.
    correlated: tuple[tuple[str, ...], ...]  # Groups of parameters whose estimates are correlated by more than 0.9.
    noise: float  # Standard deviation of the residuals that was assumed, in tolerances.
    points: int  # How many residuals there were.
    # Of the estimates in the unit box, in the order of ``intervals``; empty in journals that do not have it.
    covariance: tuple[tuple[float, ...], ...] = ()
    # Some draws from the posterior in the unit box, likewise, all equally likely: bands of predictions come from them.
    # Where draws did not come out as predicted, simulated points that follow the records as closely as draws should.
    draws: tuple[tuple[float, ...], ...] = ()

    @property
    def fixed(self) -> tuple[str, ...]:
        """The parameters that the records fix."""
        return tuple(name for name, interval in self.intervals.items() if interval.verdict == "fixed")

    @property
    def loose(self) -> tuple[str, ...]:
        """The parameters that the records narrow down without fixing them."""
        return tuple(name for name, interval in self.intervals.items() if interval.verdict == "loose")

    @property
    def open(self) -> tuple[str, ...]:
        """The parameters of which the records say next to nothing."""
        return tuple(name for name, interval in self.intervals.items() if interval.verdict == "open")

    @property
    def apart(self) -> tuple[str, ...]:
        """The parameters whose fitted values lie outside their intervals: others follow the records clearly better."""
        return tuple(name for name, one in self.intervals.items() if not one.lower <= one.value <= one.upper)


def residual_noise(residual: FloatArray, parameters: int, floor: float = 0.0) -> float:
    """Standard deviation of the residuals at the optimum, shape (m,), degrees of freedom counted, in tolerances.

    It is ``floor`` at least, what the instrument resolves at best: a fit to noiseless records would otherwise claim a
    precision that no measurement has.
    """
    freedom = max(len(residual) - parameters, 1)
    return max(float(np.sqrt(residual @ residual / freedom)), floor)


def neighbour_correlation(residual: FloatArray) -> float:
    """Correlation of each residual with the next: 0 for noise, towards 1 where the misfit follows the curve."""
    power = float(residual @ residual)
    return float(residual[:-1] @ residual[1:]) / power if power > 0 else 0.0


def is_structured(residual: FloatArray) -> bool:
    """Whether residuals, in tolerances and in the order of time, show a model that is wrong rather than noise."""
    return rms(residual) > _BEYOND_NOISE and neighbour_correlation(residual) > _FOLLOWS_THE_CURVE


def effective_noise(residual: FloatArray, parameters: int, floor: float) -> float:
    """Standard deviation to assume where neighbouring residuals are correlated, in tolerances.

    Neighbouring residuals of a model that is not quite right are correlated, and ten equal ones tell no more than one.
    Their correlation rho widens the standard deviation by ``sqrt((1 + rho) / (1 - rho))``, as that of the mean of a
    first-order autoregressive series. The fit has removed what parameters can follow, so that the residuals are less
    correlated than the errors: by ``(p + (p + 2) rho) / m`` on average, for m residuals and p smooth responses. A
    correlation below its own standard error, ``1 / sqrt(m)``, may be chance, and so much less of p is made up for.
    Residuals are in the order of time. The noise of the instrument, ``floor`` as in `residual_noise`, is taken as
    independent.

    References
    ----------
    Bartlett, J. R. Stat. Soc. 98 (1935) 536. Zieba & Ramza, Metrol. Meas. Syst. 18 (2011) 529. Kendall, Biometrika 41
    (1954) 403 (the bias, of a mean and of a trend).
    """
    seen, count = max(neighbour_correlation(residual), 0.0), len(residual)
    removed = min(parameters, _OF_A_SERIES * count) * min(seen * np.sqrt(count), 1.0)
    alike = min((count * seen + removed) / max(count - removed - 2, 1), _MOST_ALIKE)
    return max(residual_noise(residual, parameters) * float(np.sqrt((1 + alike) / (1 - alike))), floor)


def identify(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, candidate: Candidate, noise: float
) -> Identifiability:
    """Judge a fit by its Jacobian.

    The intervals are linear approximations (delta method) in the unit box, carried to the parameter's
    unit along its own scale. They take the model as right; where it is not, the values are off by more.

    Parameters
    ----------
    jacobian, residual : ndarray of shapes (m, p) and (m,)
        Residuals at the optimum, and their derivatives in the unit box.
    noise : float
        Standard deviation to assume, in tolerances, for example `effective_noise`.
    """
    covariance = covariance_of(jacobian, noise)
    factor = float(student.ppf(0.5 + _CONFIDENCE / 2, max(len(residual) - len(space), 1)))
    half = factor * np.sqrt(np.diag(covariance))
    return Identifiability(
        intervals=_about(space, candidate, half),
        combinations=_combinations(jacobian, noise, factor, space.names),
        correlated=_correlated(covariance, space.names),
        noise=noise,
        points=len(residual),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
    )


def with_sample(found: Identifiability, draws: FloatArray, space: ParameterSpace, holds_fit: bool) -> Identifiability:
    """The same with intervals and covariance of a sample of the posterior, draws of shape (n, p) in the unit box.

    ``holds_fit`` is whether the fit is as likely as draws are: every interval then contains the fitted value.
    """
    intervals = {}
    for parameter, column in zip(space, draws.T, strict=True):
        value = found.intervals[parameter.name].value
        lower, upper = _ends(column, parameter.to_unit(value) if holds_fit else None)
        half = 0.5 * (upper - lower)
        ends = [parameter.from_unit(lower), parameter.from_unit(upper), *[value] * holds_fit]
        intervals[parameter.name] = Interval(value, min(ends), max(ends), half, _verdict(half))
    covariance = np.atleast_2d(np.cov(draws.T))
    some = np.random.default_rng(0).permutation(len(draws))[:DRAWS_KEPT]
    return replace(
        found,
        intervals=intervals,
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        draws=tuple(tuple(row) for row in draws[some].tolist()),
    )


def _ends(draws: FloatArray, fitted: float | None) -> tuple[float, float]:
    """The ends of an interval with 95 % of the draws: with equal tails, or moved until it holds the fitted value.

    Where a fit ends at a bound, or in a corner of a valley, fewer than a fortieth of the draws lie beyond it, and an
    interval with equal tails would leave it out however good the fit is.
    """
    tail = 0.5 - _CONFIDENCE / 2
    if fitted is not None:
        below, above = float(np.mean(draws < fitted)), float(np.mean(draws > fitted))
        tail = min(max(tail, 1.0 - _CONFIDENCE - above), below)
    lower, upper = np.quantile(draws, [tail, min(tail + _CONFIDENCE, 1.0)]).tolist()
    return (lower, upper) if fitted is None else (min(lower, fitted), max(upper, fitted))


def not_narrower(found: Identifiability, other: Identifiability, space: ParameterSpace) -> Identifiability:
    """The same with intervals that contain those of another analysis too."""
    intervals = {}
    for parameter in space:
        one, two = found.intervals[parameter.name], other.intervals[parameter.name]
        places = [parameter.to_unit(end) for end in (one.lower, one.upper, two.lower, two.upper)]
        half = max(0.5 * (max(places) - min(places)), one.share_of_range)
        lower, upper = parameter.from_unit(min(places)), parameter.from_unit(max(places))
        intervals[parameter.name] = Interval(one.value, lower, upper, half, _verdict(half))
    return replace(found, intervals=intervals)


def _about(space: ParameterSpace, candidate: Candidate, half: FloatArray) -> dict[str, Interval]:
    """Intervals of so many units of the box to either side of a candidate, cut at the bounds."""
    return {
        parameter.name: Interval(
            value=float(candidate[parameter.name]),
            lower=parameter.from_unit(max(float(place - width), 0.0)),
            upper=parameter.from_unit(min(float(place + width), 1.0)),
            share_of_range=float(width),
            verdict=_verdict(float(width)),
        )
        for parameter, place, width in zip(space, space.to_unit(candidate), half, strict=True)
    }


def covariance_of(jacobian: FloatArray, noise: float) -> FloatArray:
    """Covariance of the estimates in the unit box, shape (p, p); a direction without data keeps that of the box."""
    singular, rows = _decomposed(jacobian)
    return np.asarray((rows.T * _variances(singular, noise)) @ rows)


def _decomposed(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All p singular values, zeros included, and the directions as rows."""
    # Squaring the Jacobian would lose the small ones: its triangular factor has the same.
    count = jacobian.shape[1]
    padded = np.vstack([jacobian, np.zeros((count, count))])
    _, singular, rows = np.linalg.svd(np.linalg.qr(padded, mode="r"))
    return singular, rows


def _variances(singular: FloatArray, noise: float) -> FloatArray:
    with np.errstate(divide="ignore"):
        information = np.square(singular / noise) if noise > 0 else np.where(singular > 0, np.inf, 0.0)
    return np.asarray(1.0 / (information + 1.0 / _BOX_VARIANCE))


def _combinations(jacobian: FloatArray, noise: float, factor: float, names: tuple[str, ...]) -> tuple[Combination, ...]:
    singular, rows = _decomposed(jacobian)
    found: list[Combination] = []
    for value, row, variance in zip(singular, rows, _variances(singular, noise), strict=True):
        order = np.argsort(-np.abs(row))
        row = row * np.sign(row[order[0]])
        weights = {names[place]: float(row[place]) for place in order if abs(row[place]) >= _NAMED_WEIGHT}
        width = factor * float(np.sqrt(variance))
        found.append(Combination(weights, float(value), width, _verdict(width)))
    return tuple(found)


def _correlated(covariance: FloatArray, names: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    count, group = connected_components(np.abs(covariance / np.outer(scale, scale)) > _CORRELATED, directed=False)
    groups = [np.flatnonzero(group == number) for number in range(count)]
    return tuple(tuple(names[place] for place in places) for places in groups if len(places) > 1)


def unsettled(
    jacobian: FloatArray, residual: FloatArray, noise: float, names: tuple[str, ...], centre: FloatArray
) -> tuple[str, ...]:
    """The parameters that one more linear step inside the bounds would move beyond their own interval.

    Around such a place intervals mean nothing: the fit has stopped short of its optimum. A fit that has come to its
    optimum at a bound has not, however far beyond the bound the step would lead. The arguments are those of `identify`,
    and the fitted parameters in the unit box, ``centre``, of shape (p,).
    """
    if noise <= 0:
        return ()
    covariance = covariance_of(jacobian, noise)
    # What the bounds alone say of a parameter counts as it does in the covariance.
    known = np.vstack([jacobian, noise * _BOX_VARIANCE**-0.5 * np.eye(len(names))])
    left = np.append(residual, np.zeros(len(names)))
    step = bounded_step(known, left, np.minimum(-centre, 0.0), np.maximum(1.0 - centre, 0.0), np.inf)
    half = NORMAL_95 * np.sqrt(np.diag(covariance))
    return tuple(name for name, moved, width in zip(names, step, half, strict=True) if abs(moved) > width)


def open_directions(jacobian: FloatArray, noise: float) -> FloatArray:
    """The directions of the unit box that the records do not fix, as rows, least known first, shape (q, p)."""
    singular, rows = _decomposed(jacobian)
    widths = NORMAL_95 * np.sqrt(_variances(singular, noise))
    return np.asarray(rows[widths > _FIXED][::-1])


def _verdict(half_width: float) -> Verdict:
    if half_width <= _FIXED:
        return "fixed"
    return "loose" if half_width <= _LOOSE else "open"
