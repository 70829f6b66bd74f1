"""The step of the linearised problem, with bounds and priors, and the decrease that it predicts."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from ..parameters import ParameterSpace
from ..trajectory import FloatArray


def linear_step(
    jacobian: FloatArray,
    here: FloatArray,
    prior_weights: FloatArray,
    u: FloatArray,
    damping: float,
    lower: FloatArray,
    upper: FloatArray,
) -> tuple[FloatArray, float]:
    """The damped Gauss-Newton step inside the bounds and the fall in cost it promises.

    Parameters
    ----------
    jacobian : ndarray of shape (n, p)
        Derivative of the residuals by the coordinates.
    here : ndarray of shape (n,)
        The residuals, without the priors.
    prior_weights : ndarray of shape (p,)
        What each coordinate costs.
    u : ndarray of shape (p,)
        Where the picture was taken.
    damping : float
        Marquardt's, relative to the squared length of each column.
    lower, upper : ndarray of shape (p,)
        Bounds of the coordinates.
    """
    scale = np.sqrt(damping * (np.sum(jacobian**2, axis=0) + prior_weights**2) + 1e-9)
    matrix = np.vstack([jacobian, np.diag(prior_weights)])
    target = -np.concatenate([here, prior_weights * u])
    # One small triangular system instead of a tall one.
    q, r = np.linalg.qr(matrix)
    reduced = q.T @ target
    gap = 1e-9
    solved = lsq_linear(
        np.vstack([r, np.diag(scale)]),
        np.concatenate([reduced, np.zeros(len(u))]),
        bounds=(np.minimum(lower - u, -gap), np.maximum(upper - u, gap)),
        method="bvls",
    )
    step = np.clip(u + solved.x, lower, upper) - u
    before = float(target @ target)
    after = float(np.sum((matrix @ step - target) ** 2))
    return step, before - after


def trusted_range(space: ParameterSpace, u: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Bounds of the coordinates within which a linear picture is trusted: ``reach`` to either side at most."""
    lower = np.maximum(space.lowest - u, -reach)
    upper = np.minimum(space.highest - u, reach)
    return u + np.minimum(lower, -1e-9), u + np.maximum(upper, 1e-9)


def trusted_step(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, u: FloatArray, reach: float
) -> tuple[FloatArray, float]:
    """The step that a linear picture asks for, ``reach`` in any coordinate at most, and the promised fall in cost."""
    return linear_step(jacobian, residual, space.prior_weights, u, 1e-8, *trusted_range(space, u, reach))
