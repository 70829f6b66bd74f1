"""Whether what is left is noise: tests of size and of structure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..trajectory import FloatArray

FALSE_ALARM = 0.01
"""Probability that noise alone is taken for a discrepancy."""

_BLOCK = 4
"""Residuals in a block of the test for structure."""

_LONE = 3.0
"""Standard deviations beyond which a residual that is larger than both its neighbours is cut to their size."""


@dataclass(frozen=True)
class Adequacy:
    """How a fit's residual compares with noise."""

    p_size: float  # Probability that noise alone leaves residuals this large.
    p_structure: float  # Probability that noise alone leaves neighbours that agree this much.
    # Factor by which correlated neighbours raise the variance of a mean: ``(1 + r) / (1 - r)``, where ``r`` is the
    # correlation of neighbours. So many residuals tell as much as a single independent one.
    variance_inflation: float

    @property
    def adequate(self) -> bool:
        """Whether noise explains the residual, at the false-alarm rate `FALSE_ALARM` for both tests together."""
        return self.noise_only(FALSE_ALARM)

    def noise_only(self, false_alarm: float) -> bool:
        """Whether noise explains the residual, at a false-alarm rate for both tests together."""
        return min(self.p_size, self.p_structure) > false_alarm / 2


def judge(
    residual: FloatArray, steps: NDArray[np.intp], taken: FloatArray | None = None, noise_freedom: float = np.inf
) -> Adequacy:
    """Test whether residuals are noise.

    Two tests. Size: the sum of their squares. Structure: the sum of squares of the means of blocks of four neighbours
    within a step, scaled to unit variance. In both, a residual that stands alone counts for little (`_without_lone`):
    noise with long tails is no physics.

    Parameters
    ----------
    residual : ndarray of shape (n,)
        Residuals in standard deviations.
    steps : ndarray of int, shape (n,)
        The step of each residual; neighbours that belong to different records are in different steps.
    taken : ndarray of shape (n, k), optional
        What the fit has removed from the noise of all residuals: the residuals of noise have the covariance
        ``1 - taken @ taken.T`` (`Refit.taken`). None where nothing was fitted.
    noise_freedom : float
        Degrees of freedom of the estimated standard deviations: sums of squares are compared with the F distribution,
        or with chi-squared where the deviations are known (infinite).
    """
    removed = np.zeros((len(residual), 0)) if taken is None else taken
    begins = np.append(True, steps[1:] != steps[:-1])
    first = np.flatnonzero(begins)[np.cumsum(begins) - 1]
    blocks = np.cumsum(begins | ((np.arange(len(steps)) - first) % _BLOCK == 0)) - 1
    tamed = _without_lone(residual, steps)
    products = (residual[1:] * residual[:-1])[~begins[1:]]
    power = max(float(residual @ residual) / len(residual), 1e-12)
    correlation = float(np.clip(np.mean(products) / power, 0.0, 0.95)) if len(products) else 0.0
    return Adequacy(
        _exceeded(tamed, removed, noise_freedom),
        _exceeded(_of_blocks(tamed, blocks), _of_blocks(removed, blocks), noise_freedom),
        (1 + correlation) / (1 - correlation),
    )


def _of_blocks(values: FloatArray, blocks: NDArray[np.intp]) -> FloatArray:
    """Sums over blocks, of independent values of variance one to such; along the first axis of the values."""
    sizes = np.bincount(blocks)
    sums = np.add.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1)), axis=0)
    return np.asarray((sums.T / np.sqrt(sizes)).T)


def _without_lone(residual: FloatArray, group: NDArray[np.intp]) -> FloatArray:
    """Residuals without lone large ones.

    Inside a step, a residual beyond `_LONE` that is larger than both its neighbours is cut to the larger of these, but
    not below `_LONE`: what a model lacks shows in neighbours too. The ends of a step are kept, where it may not.
    """
    size, beside = np.abs(residual), np.full(len(residual), np.inf)
    inner = (group[1:-1] == group[:-2]) & (group[1:-1] == group[2:])
    beside[1:-1][inner] = np.maximum(size[:-2], size[2:])[inner]
    limit = np.maximum(beside, _LONE)
    return np.clip(residual, -limit, limit)


def _exceeded(values: FloatArray, removed: FloatArray, noise_freedom: float) -> float:
    """Probability that noise leaves a sum of squares as large as that of the values.

    Their covariance is ``1 - removed @ removed.T``. The sum is taken as a multiple of a chi-squared variable with the
    same mean and variance (Satterthwaite, Biometrics Bull. 2 (1946) 110). The variance that the values are in units of
    was estimated with ``noise_freedom`` degrees of freedom.
    """
    overlaps = removed.T @ removed
    mean = len(values) - float(np.trace(overlaps))
    spread = len(values) - 2.0 * float(np.trace(overlaps)) + float(np.sum(overlaps**2))
    if mean < 1.0 or spread <= 0.0:
        # The fit has as many parameters as values: what is left of these is no evidence.
        return 1.0
    freedom = mean**2 / spread
    squares = float(values @ values) * freedom / mean
    if np.isinf(noise_freedom):
        return float(stats.chi2.sf(squares, freedom))
    return float(stats.f.sf(squares / freedom, freedom, noise_freedom))
