"""The score test: whether a little of an effect would take the residual in the right direction."""

from dataclasses import dataclass

import numpy as np

from ..bounded_step import bounded_step
from ..inference.refit import Refit
from ..trajectory import FloatArray

_REACH = 3.0
"""Standard deviations of the priors by which base parameters may move in a linear prediction."""


@dataclass(frozen=True)
class Score:
    """What a linear extrapolation says of an effect, or one of its strengths that was simulated."""

    amplitude: float  # Estimated strength, in units of the probe; 0 where only the forbidden sign would help.
    # Standard score of the strength with everything that the fitted parameters imitate projected out; the sign says
    # whether the effect points the allowed way.
    z: float
    gain: float  # Fall in the sum of squares that strength and parameters together promise, within bounds.


def score_effect(fit: Refit, sensitivity: FloatArray, bounds: tuple[float, float]) -> Score:
    """Score one effect at the null, on what a fit without it leaves.

    With ``r`` the weighted residual (data minus model), ``J`` its derivative by the fitted parameters and ``d`` by the
    strength, the projected sensitivity is ``d_p = d - J (J^T J + B)^-1 J^T d`` with the priors' weights ``B``; the
    estimated strength is ``-d_p.r / d_p.d_p`` (Rao's score test; Rao 1948, doi:10.1017/S0305004100023987).
    ``sensitivity`` is ``d`` per probe, of shape (n,); ``bounds`` are those of the strength, in probes from the null.
    """
    residual, jacobian, prior_weights = fit.residual, fit.jacobian, fit.space.prior_weights
    projected, (information, prior) = _projected(fit, sensitivity), fit.curvatures
    free = residual - jacobian @ np.linalg.solve(information + prior, jacobian.T @ residual + prior_weights**2 * fit.u)
    size = float(projected @ projected)
    if float(sensitivity @ sensitivity) < 1e-6 or size < 1e-9:
        return Score(0.0, 0.0, 0.0)
    wanted = -float(projected @ free) / size
    lower, upper = _room(fit)
    step, gain = _bounded(
        np.column_stack([jacobian, sensitivity]),
        residual,
        np.append(prior_weights, 0.0),
        np.append(fit.u, 0.0),
        np.append(lower, min(bounds[0], 0.0)),
        np.append(upper, max(bounds[1], 0.0)),
    )
    _, without = trusted_step(fit, residual)
    return Score(float(np.clip(step[-1], *bounds)), wanted * np.sqrt(size), max(gain - without, 0.0))


def overlap(fit: Refit, one: FloatArray, other: FloatArray) -> float:
    """Share of what one sensitivity explains that another one explains too, beside the parameters of a fit.

    It is the squared cosine of the angle between the projected sensitivities, see `score_effect`.
    """
    one, other = _projected(fit, one), _projected(fit, other)
    size = float(one @ one) * float(other @ other)
    return float(one @ other) ** 2 / size if size > 0.0 else 0.0


def trusted_step(fit: Refit, residual: FloatArray) -> tuple[FloatArray, float]:
    """The step from where a fit ended that lowers a residual most, and the fall in cost, by the fit's own Jacobian.

    The linear model is trusted as far as `_REACH` in each coordinate.
    """
    return _bounded(fit.jacobian, residual, fit.space.prior_weights, fit.u, *_room(fit))


def _projected(fit: Refit, sensitivity: FloatArray) -> FloatArray:
    """A sensitivity without what the fitted parameters imitate."""
    jacobian, (information, prior) = fit.jacobian, fit.curvatures
    return np.asarray(sensitivity - jacobian @ np.linalg.solve(information + prior, jacobian.T @ sensitivity))


def _room(fit: Refit) -> tuple[FloatArray, FloatArray]:
    """How far each coordinate may move down and up within its bounds."""
    lower = np.minimum(np.maximum(fit.space.lowest - fit.u, -_REACH), 0.0)
    upper = np.maximum(np.minimum(fit.space.highest - fit.u, _REACH), 0.0)
    return lower, upper


def _bounded(
    jacobian: FloatArray, residual: FloatArray, prior: FloatArray, u: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, float]:
    """The step with the least predicted cost, and how much that is less than the present one."""
    matrix, target = np.vstack([jacobian, np.diag(prior)]), np.concatenate([residual, prior * u])
    step = bounded_step(matrix, target, lower, upper, np.inf)
    return step, float(target @ target) - float(np.sum((matrix @ step + target) ** 2))
