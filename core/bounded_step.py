"""The step of a least-squares fit: no longer than the linear model is trusted, and within the bounds."""

import numpy as np
from scipy.optimize import lsq_linear

from .trajectory import FloatArray

_BISECTIONS = 12
"""Halvings of the logarithm of the damping; the radius need not be met exactly (Nocedal & Wright, Sec. 4.3)."""

_LEAST_DAMPING = 1e-14
"""Damping relative to the largest squared singular value: picks the shortest step where many are equally good."""


def bounded_step(
    jacobian: FloatArray, residual: FloatArray, lower: FloatArray, upper: FloatArray, radius: float
) -> FloatArray:
    """Minimise ``||J d + r||`` over ``lower <= d <= upper`` and ``||d|| <= radius``.

    Levenberg's damping (1944) is raised until the step is short enough, so that it is small in directions to which the
    residuals are hardly sensitive (Marquardt 1963; Moré 1978). Limits of each coordinate alone would lead to the
    corners of the box instead.

    Parameters
    ----------
    jacobian : ndarray of shape (m, p)
        Change of the residuals per unit of each coordinate.
    residual : ndarray of shape (m,)
        Residuals at the base.
    lower, upper : ndarray of shape (p,)
        Room on both sides of the base, ``lower <= 0 <= upper``. Where they are equal nothing moves.

    Returns
    -------
    ndarray of shape (p,)
    """
    step = np.zeros(len(lower))
    # A coordinate on its bound, with its room on the other side, is free: the solver finds out.
    free = upper - lower > 0
    if not np.any(free) or radius <= 0:
        return step
    factor, target = _reduced(jacobian[:, free], -residual)
    strength = float(np.linalg.norm(factor, 2))
    if strength == 0.0:
        return step
    most = float(np.linalg.norm(factor.T @ target)) / radius  # damping that is certainly enough
    least, same = _LEAST_DAMPING * strength**2, np.ones(factor.shape[1])
    found = _damped(factor, target, lower[free], upper[free], least * same)
    if np.linalg.norm(found) > radius and most > least:
        for _ in range(_BISECTIONS):
            middle = float(np.sqrt(least * most))
            trial = _damped(factor, target, lower[free], upper[free], middle * same)
            if np.linalg.norm(trial) > radius:
                least = middle
            else:
                most, found = middle, trial
        length = float(np.linalg.norm(found))
        if length > radius:
            found *= radius / length
    step[free] = found
    return step


def damped_step(
    jacobian: FloatArray, residual: FloatArray, lower: FloatArray, upper: FloatArray, damping: float
) -> FloatArray:
    """Minimise ``||J d + r||^2 + damping ||D d||^2`` over ``lower <= d <= upper``, ``D`` the norms of the columns.

    Marquardt's damping (1963) shortens the step in directions to which the residuals are sensitive, where it may lead
    over a kink of theirs, and hardly in directions to which they are not.

    Parameters
    ----------
    jacobian, residual, lower, upper : ndarray
        See `bounded_step`.
    damping : float
        Relative to the squared norm of each column.

    Returns
    -------
    ndarray of shape (p,)
    """
    step = np.zeros(len(lower))
    free = upper - lower > 0
    squares = np.sum(jacobian[:, free] ** 2, axis=0)
    if not np.any(squares > 0):
        return step
    factor, target = _reduced(jacobian[:, free], -residual)
    step[free] = _damped(factor, target, lower[free], upper[free], damping * squares + _LEAST_DAMPING * np.max(squares))
    return step


def _reduced(jacobian: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same problem in p rows: what is orthogonal to the Jacobian cannot be changed."""
    orthogonal, factor = np.linalg.qr(jacobian)
    return factor, orthogonal.T @ target


def _damped(
    factor: FloatArray, target: FloatArray, lower: FloatArray, upper: FloatArray, damping: FloatArray
) -> FloatArray:
    stacked = np.vstack([factor, np.diag(np.sqrt(damping))])
    wanted = np.concatenate([target, np.zeros(len(damping))])
    free = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    if np.all(free >= lower) and np.all(free <= upper):
        return np.asarray(free)
    found = lsq_linear(stacked, wanted, bounds=(lower, upper), method="bvls").x
    return np.asarray(np.clip(found, lower, upper))
