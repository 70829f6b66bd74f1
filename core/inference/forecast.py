"""What one more record would do to the intervals, before it is measured."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..normal import NORMAL_95
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
    names: tuple[str, ...],
    noise: float,
) -> tuple[Forecast, ...]:
    """Rank candidate protocols by how far each would shrink the widest interval (minimax design).

    Parameters
    ----------
    jacobian : ndarray of shape (m, p)
        Derivatives of the residuals of what was measured, in the unit box.
    candidates : mapping of str to ndarray of shape (k, p)
        For each protocol the derivatives of its residuals, in the same tolerances.
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
    for protocol, rows in candidates.items():
        covariance = covariance_of(np.vstack([jacobian, rows]), noise)
        widths = NORMAL_95 * np.sqrt(np.diag(covariance))
        shares = dict(zip(names, widths.tolist(), strict=True))
        worst = max(shares, key=lambda name: shares[name])
        forecasts.append(Forecast(protocol, worst, shares[worst], shares))
    return tuple(sorted(forecasts, key=lambda item: (item.worst_share, sum(item.shares.values()))))
