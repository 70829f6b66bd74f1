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

_LONE = 3.0
"""Deviations that a reading which stands alone counts for at most."""


@dataclass(frozen=True)
class Adequacy:
    """How a fit's residual compares with noise."""

    p_size: float  # Probability that noise alone leaves residuals this large.
    p_structure: float  # Probability that noise alone leaves neighbours agreeing this much.
    repetition: float  # How many neighbours say what one would: ``(1 + r) / (1 - r)`` with ``r`` their correlation.

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
    """Test residuals of several records, in standard deviations; with the step of each residual.

    Size: the mean of squares against the F distribution, since the deviations are estimates of ``noise_freedom``
    degrees of freedom (chi-squared where they are known). Structure: means of blocks of neighbours within a step,
    scaled to unit variance, whose squares noise alone makes as large; four neighbours that agree on half a
    standard deviation each pass the first test and fail this one. Both count a reading that stands alone for little
    (`_without_lone`): noise with long tails is no physics. Both lose the degrees of freedom of the
    ``fitted`` parameters, of which those that priors hold count for less (`Refit.effective_parameters`). The
    deviations contain the floor below which differences are not physics, which lowers the rate of false alarms.
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
    """Residuals in which one that is farther off than both its neighbours in a step is as far as the farther of them.

    What a model lacks shows in neighbours too. At the ends of a step it may not: they stay.
    """
    size, beside = np.abs(residual), np.full(len(residual), np.inf)
    inner = (group[1:-1] == group[:-2]) & (group[1:-1] == group[2:])
    beside[1:-1][inner] = np.maximum(size[:-2], size[2:])[inner]
    limit = np.maximum(beside, _LONE)
    return np.clip(residual, -limit, limit)


def _exceeded(squares: float, freedom: float, noise_freedom: float) -> float:
    """Probability that noise leaves a sum of squares so large, in units of a variance that is itself an estimate."""
    if np.isinf(noise_freedom):
        return float(stats.chi2.sf(squares, freedom))
    return float(stats.f.sf(squares / freedom, freedom, noise_freedom))
