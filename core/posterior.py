"""What records leave of the parameters: a sample of the posterior, in coordinates whose prior is standard normal.

A linear interval takes responses as linear. The sample follows the cost wherever it bends, and keeps within the bounds
because the coordinates do (`Prior.unit`).

References
----------
Goodman & Weare, Commun. Appl. Math. Comput. Sci. 5 (2010) 65 (stretch moves). ter Braak, Stat. Comput. 16 (2006) 239
(differential evolution moves).
"""

from collections.abc import Callable

import numpy as np

from .trajectory import FloatArray

_STRETCH = 2.0
"""Longest stretch of a move, as its authors have it."""

_ALONG = 0.5
"""Share of moves along the difference of two walkers: beyond ten parameters hardly a stretch is taken."""

_JUMP, _SCALES = 2.38, (0.3, 1.1)
"""Length of such a move over the root of twice the parameters, as its author has it, and of which shares are drawn: a
curved valley wants shorter ones."""

_WHOLE = 0.1
"""Share of these moves that go the whole difference: from one valley to another."""

_WALKERS = 6
"""Walkers for each parameter; the sampler needs twice the parameters at least."""

_FEWEST = 20

MOVES, _BURNT, _KEPT_EVERY = 2400, 0.25, 12
"""Moves of every walker, the share of them not counted, and how many lie between two that are kept: about one time of
autocorrelation at ten parameters."""

_STRANDED = 4
"""Of so many draws one goes on, the one of least cost: what a first guess left far from everything stays there."""


def beginning(centre: FloatArray, residual: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Walkers spread as the posterior of a linear response; an even number.

    Parameters
    ----------
    centre, residual, jacobian : ndarray of shapes (p,), (m,) and (m, p)
        Of the response, in standard deviations and in coordinates whose prior is standard normal.
    """
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(centre)))
    mean = centre - covariance @ (jacobian.T @ residual + centre)
    normal = np.random.default_rng(0).standard_normal((_count(len(centre)), len(centre)))
    return np.asarray(mean + normal @ np.linalg.cholesky(covariance).T)


def going_on(draws: FloatArray, costs: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Walkers from the draws of a sample, for one of another cost; as many as `beginning` makes."""
    count = _count(draws.shape[1])
    some = np.random.default_rng(0).permutation(len(draws))[: _STRANDED * count]
    order = np.argsort(costs(draws[some]))[:count]
    return np.asarray(draws[some[order]])


def sample(
    costs: Callable[[FloatArray], FloatArray], walkers: FloatArray, moves: int = MOVES, seed: int = 0
) -> FloatArray:
    """Draws from the posterior, shape (n, p).

    Parameters
    ----------
    costs : callable
        Twice the negative logarithm of the posterior at points of shape (k, p).
    walkers : ndarray of shape (w, p)
        Where they start; an even number.
    """
    rng = np.random.default_rng(seed)
    walkers, half = walkers.copy(), len(walkers) // 2
    cost = costs(walkers)
    kept: list[FloatArray] = []
    for move in range(moves):
        for own, others in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
            there, favour = _moved(walkers[own], walkers[others], rng)
            new = costs(there)
            taken = np.log(rng.random(half)) < favour - 0.5 * (new - cost[own])
            walkers[own] = np.where(taken[:, None], there, walkers[own])
            cost[own] = np.where(taken, new, cost[own])
        if move >= _BURNT * moves and move % _KEPT_EVERY == 0:
            kept.append(walkers.copy())
    return np.concatenate(kept)


def _moved(here: FloatArray, others: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Where walkers go by the places of others, and the logarithm of what favours it beside the cost."""
    half, count = here.shape
    if rng.random() < _ALONG:
        one, other = others[rng.integers(half, size=(2, half))]
        length = 1.0 if rng.random() < _WHOLE else _JUMP / np.sqrt(2.0 * count) * rng.uniform(*_SCALES)
        return here + length * (one - other), np.zeros(half)
    stretch = np.asarray(1.0 + (_STRETCH - 1.0) * rng.random(half)) ** 2 / _STRETCH
    partner = others[rng.integers(half, size=half)]
    return partner + stretch[:, None] * (here - partner), (count - 1) * np.log(stretch)


def _count(parameters: int) -> int:
    """How many walkers there are."""
    return max(_WALKERS * parameters, _FEWEST) // 2 * 2
