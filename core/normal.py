"""The two numbers of a normal distribution that intervals and robust scatters need."""

from typing import Any

import numpy as np

NORMAL_95 = 1.96
"""Half the width of a 95 % interval, in standard deviations."""

_DEVIATION_OF_MEDIAN = 1.4826
"""Standard deviation over the median size of a deviation."""


def robust_deviation(deviations: Any) -> float:
    """Standard deviation from the median of the sizes: half of the values may be outliers.

    The deviations, of shape (n,), are centred on zero, in any unit.
    """
    return _DEVIATION_OF_MEDIAN * float(np.median(np.abs(deviations)))
