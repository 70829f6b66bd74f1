"""Draws from the posterior of a fit with many parameters: each is a fit of its own to perturbed data.

A draw of the linear approximation is off by hundreds of squared standard deviations where responses bend. A few steps
of a fit, on the derivatives that are known at the best point, bring it to where the simulation shows what the linear
draw promised: along the directions that the data fix the draw is corrected, along the others it keeps its place.

References
----------
Bardsley, Solonen, Haario & Laine, SIAM J. Sci. Comput. 36 (2014) A1895 (randomize-then-optimize).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .fit_settings import Box, Settings
from .least_squares import LeastSquares
from .prior import Prior
from .trajectory import FloatArray

_STEPS = 4
"""Steps of each draw's fit at most, after the simulation of the linear draw."""

_MET = 0.3
"""Root mean square, in standard deviations, by which a draw may miss its perturbed data."""

_NEAR = 20.0
"""Sum of squares of a linear draw, in that of the best point, up to which its fit begins there: mostly two steps
suffice. An empty cell costs hundreds of times as much, and no derivative leads back from it: such a fit begins at the
best point."""


def randomised_draws(
    centre: FloatArray,
    residual: FloatArray,
    jacobian: FloatArray,
    excess: float,
    prior: Prior,
    simulate: Callable[[FloatArray], Sequence[FloatArray | None]],
    count: int,
) -> FloatArray:
    """Draws about a fit, in the unit box, shape (n, p) with at most ``count`` of them.

    Parameters
    ----------
    centre : ndarray of shape (p,)
        The fit, in the unit box.
    residual : ndarray of shape (m,)
        Residuals there, in standard deviations.
    jacobian : ndarray of shape (m, p)
        Their derivatives there.
    excess : float
        Standard deviation in the units of what is simulated.
    simulate : callable
        Residuals at points of shape (k, p); None for one that fails.

    Notes
    -----
    A draw that is not met within its steps is the best point on its way. One that never left the fit is left out.
    """
    known = prior.about(centre)
    across, triangle = np.linalg.qr(known.jacobian(jacobian))
    here = across.T @ known.residuals(residual, centre)
    offsets = np.random.default_rng(0).standard_normal((count, len(centre)))

    def missed(places: Sequence[int], points: FloatArray) -> list[FloatArray | None]:
        """By how much simulations miss the perturbed data of draws, in the directions of the parameters."""
        return [
            None if seen is None else across.T @ known.residuals(seen / excess, point) - here - offsets[place]
            for place, point, seen in zip(places, points, simulate(points), strict=True)
        ]

    linear = np.clip(centre + np.linalg.solve(triangle, offsets.T).T, 0.0, 1.0)
    first = missed(range(count), linear)
    fits = [
        _fit(centre, -offset, triangle, point, seen) for offset, point, seen in zip(offsets, linear, first, strict=True)
    ]
    for _ in range(_STEPS):
        asked = {place: points[0] for place, fit in enumerate(fits) if (points := _step(fit))}
        if not asked:
            break
        for place, seen in zip(asked, missed(list(asked), np.array(list(asked.values()))), strict=True):
            fits[place].tell([seen])
    moved = [fit.point for fit in fits if fit.ending == "perfect" or not np.array_equal(fit.point, centre)]
    return np.array(moved).reshape(len(moved), len(centre))


def _fit(
    centre: FloatArray, at_centre: FloatArray, slopes: FloatArray, linear: FloatArray, at_linear: FloatArray | None
) -> LeastSquares:
    """The fit of a draw: from the linear one, or from the centre where that one is far off."""
    settings, box = Settings(radius=1.0, enough=_MET), Box.unit(len(centre))
    if at_linear is not None and at_linear @ at_linear <= _NEAR * (at_centre @ at_centre):
        return LeastSquares(linear, at_linear, settings, jacobian=slopes, box=box)
    return LeastSquares(centre, at_centre, settings, jacobian=slopes, box=box, fresh=True)


def _step(fit: LeastSquares) -> list[FloatArray]:
    """The next point of a fit; none where it would have its derivatives measured anew, or has ended."""
    points = fit.ask() if fit.stage == "step" else []
    return points if fit.stage == "step" else []
