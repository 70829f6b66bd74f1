"""What records leave of the parameters' ranges: a sample of the posterior on a local model.

A linear interval takes the range as endless. The sample keeps inside the bounds, within which every value is as likely
before the fit.

References
----------
Goodman & Weare, Commun. Appl. Math. Comput. Sci. 5 (2010) 65.
"""

from __future__ import annotations

import numpy as np

from .local_model import LocalModel
from .trajectory import FloatArray

_STRETCH = 2.0
"""Longest stretch of a move, as its authors have it."""

_WALKERS = 6
"""Walkers for each parameter; the sampler needs twice the parameters at least."""

_MOVES, _BURNT, _KEPT_EVERY = 2400, 600, 12
"""Moves of every walker, those not counted at first, and how many lie between two that are kept: about one time of
autocorrelation at ten parameters."""

_INSIDE = 1e-6
"""Distance from a bound at which a walker may start."""


def sample(model: LocalModel, dispersion: float = 1.0, seed: int = 0) -> FloatArray:
    """Draws from the posterior over the unit box, shape (n, p).

    Parameters
    ----------
    model : LocalModel
        Its cost is twice the negative logarithm of the likelihood.
    dispersion : float
        By which the cost is divided, where the residuals are larger than their standard deviations.
    """
    rng = np.random.default_rng(seed)
    count = len(model.centre)
    walkers = _beginning(model, dispersion, max(_WALKERS * count, 20), rng)
    costs = model.cost_function(dispersion)
    half = len(walkers) // 2
    cost = costs(walkers)
    kept: list[FloatArray] = []
    for move in range(_MOVES):
        for own, others in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
            here = walkers[own]
            partner = walkers[others][rng.integers(half, size=half)]
            stretch = (1.0 + (_STRETCH - 1.0) * rng.random(half)) ** 2 / _STRETCH
            there = partner + stretch[:, None] * (here - partner)
            inside = np.all((there >= 0.0) & (there <= 1.0), axis=1)
            new = np.where(inside, costs(there), np.inf)
            likelier = (count - 1) * np.log(stretch) - 0.5 * (new - cost[own])
            taken = np.log(rng.random(half)) < likelier
            walkers[own] = np.where(taken[:, None], there, here)
            cost[own] = np.where(taken, new, cost[own])
        if move >= _BURNT and move % _KEPT_EVERY == 0:
            kept.append(walkers.copy())
    return np.concatenate(kept)


def _beginning(model: LocalModel, dispersion: float, count: int, rng: np.random.Generator) -> FloatArray:
    """Walkers around the linear estimate, spread as the linear posterior is, inside the box; an even number."""
    mean, covariance = model.linear_estimate(dispersion)
    points = mean + rng.standard_normal((2 * (count // 2), len(mean))) @ np.linalg.cholesky(covariance).T
    # Reflected rather than cut: walkers on one bound would never leave it.
    folded = np.abs(np.mod(points + 1.0, 2.0) - 1.0)
    return np.clip(folded, _INSIDE, 1.0 - _INSIDE)
