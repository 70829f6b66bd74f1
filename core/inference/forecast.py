"""What one more record would do to the intervals, before it is measured."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..trajectory import FloatArray
from .identifiability import covariance_of


@dataclass(frozen=True)
class Forecast:
    """What one more record would do to the intervals."""

    protocol: str  # The candidate's name.
    worst: str  # The parameter that would then be known worst.
    worst_share: float  # Half the width of its interval, as a share of the range.
    shares: Mapping[str, float]  # The same for every parameter.


def what_to_measure_next(
    jacobian: FloatArray,
    candidates: Mapping[str, FloatArray],
    now: Mapping[str, float],
    noise: float,
) -> tuple[Forecast, ...]:
    """Rank candidate protocols by how far each would shrink the widest interval (minimax design).

    Parameters
    ----------
    jacobian : ndarray of shape (m, p)
        Derivatives of the residuals of what was measured, in the unit box.
    candidates : mapping of str to ndarray of shape (k, p)
        For each protocol the derivatives of its residuals, in the same tolerances.
    now : mapping of str to float
        Half the width of each parameter's present interval, as a share of the range, in the order of the derivatives.
        An interval of a sample may be wider or narrower than a linear one, so that the linear model tells by what
        factor a further record narrows it, and no more.
    noise : float
        Standard deviation of the residuals, in tolerances (`Identifiability.noise`).

    Returns
    -------
    tuple of Forecast
        Best first; among equals the one with the smaller mean width.

    References
    ----------
    Pukelsheim, Optimal Design of Experiments (2006), Ch. 6.
    """
    forecasts: list[Forecast] = []
    before = np.sqrt(np.diag(covariance_of(jacobian, noise)))
    for protocol, rows in candidates.items():
        after = np.sqrt(np.diag(covariance_of(np.vstack([jacobian, rows]), noise)))
        shares = {name: share * ratio for (name, share), ratio in zip(now.items(), after / before, strict=True)}
        worst = max(shares, key=lambda name: shares[name])
        forecasts.append(Forecast(protocol, worst, shares[worst], shares))
    return tuple(sorted(forecasts, key=lambda item: (item.worst_share, sum(item.shares.values()))))
