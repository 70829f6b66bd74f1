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


def judge(weighted: Sequence[FloatArray], groups: Sequence[NDArray[np.intp]], fitted: float) -> Adequacy:
    """Test residuals of several records, in standard deviations; with the step of each residual.

    Size: the sum of squares against chi-squared. Structure: means of blocks of neighbours within a step, scaled to
    unit variance, whose sum of squares noise alone makes chi-squared too; four neighbours that agree on half a
    standard deviation each pass the first test and fail this one. Both lose the degrees of freedom of the
    ``fitted`` parameters, of which those that priors hold count for less (`Refit.effective_parameters`). The
    deviations contain the floor below which differences are not physics, which lowers the rate of false alarms; the
    noise in them counts as known, which raises it.
    """
    flat = np.concatenate(list(weighted))
    total = float(flat @ flat)
    freedom = max(len(flat) - fitted, 1)
    blocks: list[float] = []
    products: list[float] = []
    for residual, group in zip(weighted, groups, strict=True):
        for number in np.unique(group):
            part = residual[group == number]
            if len(part) > 1:
                products += list(part[1:] * part[:-1])
            for start in range(0, len(part), _BLOCK):
                block = part[start : start + _BLOCK]
                blocks.append(float(np.sum(block) / np.sqrt(len(block))))
    squares = float(np.sum(np.square(blocks)))
    block_freedom = max(len(blocks) - fitted, 1)
    correlation = float(np.clip(np.mean(products) / max(total / len(flat), 1e-12), 0.0, 0.95)) if products else 0.0
    return Adequacy(
        float(stats.chi2.sf(total, freedom)),
        float(stats.chi2.sf(squares, block_freedom)),
        (1 + correlation) / (1 - correlation),
    )
