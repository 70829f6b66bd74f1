"""Whether what is left is noise: tests of size and of structure."""

from collections.abc import Sequence
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
    weighted: Sequence[FloatArray],
    groups: Sequence[NDArray[np.intp]],
    fitted: float,
    noise_freedom: float = np.inf,
) -> Adequacy:
    """Test whether the residuals of several records are noise.

    Two tests. Size: the sum of their squares. Structure: the sum of squares of the means of blocks of four neighbours
    within a step, scaled to unit variance. Four neighbours that are all off by half a standard deviation pass the
    first test and fail the second. In both, a residual that stands alone counts for little (`_without_lone`): noise
    with long tails is no physics.

    Parameters
    ----------
    weighted : sequence of ndarray
        Residuals of each record, in standard deviations. These contain the floor below which differences are not
        physics, so that false alarms are rarer than stated.
    groups : sequence of ndarray of int
        The step of each residual.
    fitted : float
        Degrees of freedom that the fit has taken; parameters that priors hold take less than one
        (`Refit.effective_parameters`).
    noise_freedom : float
        Degrees of freedom of the estimated standard deviations: sums of squares are compared with the F distribution,
        or with chi-squared where the deviations are known (infinite).
    """
    flat = np.concatenate(list(weighted))
    tamed = [_without_lone(residual, group) for residual, group in zip(weighted, groups, strict=True)]
    freedom = max(len(flat) - fitted, 1)
    blocks: list[float] = []
    products: list[float] = []
    for residual, near, group in zip(weighted, tamed, groups, strict=True):
        for number in np.unique(group):
            part, kept = residual[group == number], near[group == number]
            if len(part) > 1:
                products += list(part[1:] * part[:-1])
            for start in range(0, len(kept), _BLOCK):
                block = kept[start : start + _BLOCK]
                blocks.append(float(np.sum(block) / np.sqrt(len(block))))
    squares = float(np.sum(np.square(blocks)))
    block_freedom = max(len(blocks) - fitted, 1)
    power = max(float(flat @ flat) / len(flat), 1e-12)
    correlation = float(np.clip(np.mean(products) / power, 0.0, 0.95)) if products else 0.0
    return Adequacy(
        _exceeded(float(sum(near @ near for near in tamed)), freedom, noise_freedom),
        _exceeded(squares, block_freedom, noise_freedom),
        (1 + correlation) / (1 - correlation),
    )


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


def _exceeded(squares: float, freedom: float, noise_freedom: float) -> float:
    """Probability that noise leaves a sum of squares this large, in units of the variance that was estimated."""
    if np.isinf(noise_freedom):
        return float(stats.chi2.sf(squares, freedom))
    return float(stats.f.sf(squares / freedom, freedom, noise_freedom))
