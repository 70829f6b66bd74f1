"""The score test: whether a little of an effect would take the residual in the right direction."""

from dataclasses import dataclass

import numpy as np

from ..bounded_step import bounded_step
from ..parameters import ParameterSpace
from ..trajectory import FloatArray


@dataclass(frozen=True)
class Score:
    """What a linear extrapolation says of an effect, or one of its strengths that was simulated."""

    amplitude: float  # The strength it asks for, in units of the probe; 0 where only the forbidden sign would help.
    # Standard score of the strength with everything that the fitted parameters imitate projected out; the sign says
    # whether the effect points the allowed way.
    z: float
    gain: float  # Fall in the sum of squares that strength and parameters together promise, within bounds.


def score_effect(
    residual: FloatArray,
    jacobian: FloatArray,
    sensitivity: FloatArray,
    space: ParameterSpace,
    u: FloatArray,
    bounds: tuple[float, float],
    reach: float = 3.0,
) -> Score:
    """Score one effect at the null.

    With ``r`` the weighted residual (data minus model), ``J`` its derivative by the fitted parameters and ``d`` by
    the strength (``sensitivity``, per probe), the projected sensitivity is ``d_p = d - J (J^T J + B)^-1 J^T d``
    with the priors' weights ``B``; the strength that it asks for is ``-d_p.r / d_p.d_p`` (Rao's score test; Rao
    1948, doi:10.1017/S0305004100023987). ``bounds`` are the strength's, in probes with the null at 0; the linear
    picture is trusted as far as ``reach`` deviations of the priors.
    """
    prior_weights = space.prior_weights
    normal = jacobian.T @ jacobian + np.diag(prior_weights**2 + 1e-9)
    projected = sensitivity - jacobian @ np.linalg.solve(normal, jacobian.T @ sensitivity)
    free = residual - jacobian @ np.linalg.solve(normal, jacobian.T @ residual + prior_weights**2 * u)
    size = float(projected @ projected)
    if float(sensitivity @ sensitivity) < 1e-6 or size < 1e-9:
        return Score(0.0, 0.0, 0.0)
    wanted = -float(projected @ free) / size
    z = wanted * np.sqrt(size)
    with_effect = np.column_stack([jacobian, sensitivity])
    step, gain = _trusted(
        with_effect, residual, np.append(prior_weights, 0.0), np.append(u, 0.0), *_reached(space, u, reach, bounds)
    )
    _, without = trusted_step(jacobian, residual, space, u, reach)
    return Score(float(np.clip(step[-1], *bounds)), z, max(gain - without, 0.0))


def trusted_step(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, u: FloatArray, reach: float
) -> tuple[FloatArray, float]:
    """The step that the linear model asks for, ``reach`` in any coordinate at most, and the predicted fall in cost."""
    return _trusted(jacobian, residual, space.prior_weights, u, *_reached(space, u, reach))


def _reached(
    space: ParameterSpace, u: FloatArray, reach: float, strength: tuple[float, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """How far each coordinate may move to either side within its bounds, and the strength of an effect beside them."""
    lower = np.minimum(np.maximum(space.lowest - u, -reach), 0.0)
    upper = np.maximum(np.minimum(space.highest - u, reach), 0.0)
    if strength is None:
        return lower, upper
    return np.append(lower, min(strength[0], 0.0)), np.append(upper, max(strength[1], 0.0))


def _trusted(
    jacobian: FloatArray, residual: FloatArray, prior: FloatArray, u: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, float]:
    matrix, target = np.vstack([jacobian, np.diag(prior)]), np.concatenate([residual, prior * u])
    step = bounded_step(matrix, target, lower, upper, np.inf)
    return step, float(target @ target) - float(np.sum((matrix @ step + target) ** 2))
