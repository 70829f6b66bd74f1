"""What records leave of the parameters' ranges: a sample of the posterior within the bounds.

A linear interval takes the range as endless and responses as linear. The sample keeps inside the bounds, within which
every value is as likely before the fit, and follows the cost wherever it bends.

References
----------
Goodman & Weare, Commun. Appl. Math. Comput. Sci. 5 (2010) 65.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .trajectory import FloatArray

_STRETCH = 2.0
"""Longest stretch of a move, as its authors have it."""

_WALKERS = 6
"""Walkers for each parameter; the sampler needs twice the parameters at least."""

_FEWEST = 20

MOVES, _BURNT, _KEPT_EVERY = 2400, 0.25, 12
"""Moves of every walker, the share of them not counted, and how many lie between two that are kept: about one time of
autocorrelation at ten parameters."""

_INSIDE = 1e-6
"""Distance from a bound at which a walker may start."""

_STRANDED = 4
"""Of so many draws one goes on, the one of least cost: what a first guess left far from everything stays there."""


def beginning(mean: FloatArray, covariance: FloatArray, seed: int = 0) -> FloatArray:
    """Walkers spread as a normal distribution, inside the box; an even number."""
    rng = np.random.default_rng(seed)
    count = max(_WALKERS * len(mean), _FEWEST)
    points = mean + rng.standard_normal((2 * (count // 2), len(mean))) @ np.linalg.cholesky(covariance).T
    # Reflected rather than cut: walkers on one bound would never leave it.
    folded = np.abs(np.mod(points + 1.0, 2.0) - 1.0)
    return np.clip(folded, _INSIDE, 1.0 - _INSIDE)


def going_on(draws: FloatArray, costs: Callable[[FloatArray], FloatArray], seed: int = 0) -> FloatArray:
    """Walkers from the draws of a sample, for one of another cost; as many as `beginning` makes."""
    count = max(_WALKERS * draws.shape[1], _FEWEST)
    some = np.random.default_rng(seed).permutation(len(draws))[: _STRANDED * 2 * (count // 2)]
    order = np.argsort(costs(draws[some]))[: 2 * (count // 2)]
    return np.asarray(draws[some[order]])


def sample(
    costs: Callable[[FloatArray], FloatArray], walkers: FloatArray, moves: int = MOVES, seed: int = 0
) -> FloatArray:
    """Draws from the posterior over the unit box, shape (n, p).

    Parameters
    ----------
    costs : callable
        Twice the negative logarithm of the likelihood at points of shape (k, p).
    walkers : ndarray of shape (w, p)
        Where they start, inside the box; an even number.
    """
    rng = np.random.default_rng(seed)
    walkers, half, count = walkers.copy(), len(walkers) // 2, walkers.shape[1]
    cost = costs(walkers)
    kept: list[FloatArray] = []
    for move in range(moves):
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
        if move >= _BURNT * moves and move % _KEPT_EVERY == 0:
            kept.append(walkers.copy())
    return np.concatenate(kept)
