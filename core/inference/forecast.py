"""What one more record would do to the intervals, before it is measured."""

from collections.abc import Mapping

import numpy as np

from ..trajectory import FloatArray
from .identifiability import covariance_of


def what_to_measure_next(
    jacobian: FloatArray,
    candidates: Mapping[str, FloatArray],
    now: Mapping[str, float],
    noise: float,
) -> dict[str, dict[str, float]]:
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
    dict of str to dict of str to float
        For each protocol half the width that each parameter's interval would have, as a share of the range; best
        first, among equals the one with the smaller mean width.

    References
    ----------
    Pukelsheim, Optimal Design of Experiments (2006), Ch. 6.
    """
    forecasts: dict[str, dict[str, float]] = {}
    before = np.sqrt(np.diag(covariance_of(jacobian, noise)))
    for protocol, rows in candidates.items():
        after = np.sqrt(np.diag(covariance_of(np.vstack([jacobian, rows]), noise)))
        forecasts[protocol] = {
            name: share * ratio for (name, share), ratio in zip(now.items(), after / before, strict=True)
        }
    widths = {protocol: (max(shares.values()), sum(shares.values())) for protocol, shares in forecasts.items()}
    return {protocol: forecasts[protocol] for protocol in sorted(forecasts, key=lambda protocol: widths[protocol])}
