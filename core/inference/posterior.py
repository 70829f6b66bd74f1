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

from ..trajectory import FloatArray

_STRETCH = 2.0
"""Largest factor of a stretch move, the value of its authors (Goodman & Weare)."""

_ALONG = 0.5
"""Share of moves along the difference of two walkers: with more than ten parameters few stretch moves are accepted."""

_JUMP, _SCALES = 2.38, (0.3, 1.1)
"""Length of a move along a difference, times the root of twice the number of parameters (the value of its author, ter
Braak), and the range of random factors on it: a curved valley needs shorter moves."""

_WHOLE = 0.1
"""Share of these moves that have the length of the difference: they lead from one valley to another."""

_WALKERS = 6
"""Walkers for each parameter; the sampler needs twice the parameters at least."""

_FEWEST = 20
"""Walkers at least, however few the parameters are."""

MOVES, _BURNT, _KEPT_EVERY = 2400, 0.25, 12
"""Moves of every walker, the share of them not counted, and how many lie between two that are kept: about one time of
autocorrelation at ten parameters."""

_STRANDED = 4
"""Draws for each walker of the next sample; those of least cost become walkers. Some draws of a rough first sample lie
far from all others."""


def beginning(centre: FloatArray, residual: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Walkers spread as the posterior of a linear response; an even number.

    ``centre``, ``residual`` and ``jacobian``, of shapes (p,), (m,) and (m, p), are those of the response, in standard
    deviations and in the coordinates of `sample`.
    """
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(centre)))
    mean = centre - covariance @ (jacobian.T @ residual + centre)
    normal = np.random.default_rng(0).standard_normal((_count(len(centre)), len(centre)))
    return np.asarray(mean + normal @ np.linalg.cholesky(covariance).T)


def going_on(draws: FloatArray, costs: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Walkers for a sample of another cost, taken from the draws of an earlier one; as many as `beginning` makes."""
    count = _count(draws.shape[1])
    some = np.random.default_rng(0).permutation(len(draws))[: _STRANDED * count]
    order = np.argsort(costs(draws[some]))[:count]
    return np.asarray(draws[some[order]])


def sample(costs: Callable[[FloatArray], FloatArray], walkers: FloatArray, moves: int = MOVES) -> FloatArray:
    """Draws from the posterior, shape (n, p), in coordinates whose prior is standard normal.

    ``costs`` is twice the negative logarithm of the posterior at points of shape (k, p). The walkers, of shape (w, p)
    where they start, are an even number.
    """
    rng = np.random.default_rng(0)
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
    """Proposed places of walkers, and the logarithm of the factor of acceptance that is not due to the cost."""
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
