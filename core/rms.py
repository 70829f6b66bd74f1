"""The root mean square."""

import numpy as np
from numpy.typing import NDArray


def rms(values: NDArray[np.float64] | None) -> float:
    """Root mean square of all values; infinite for none."""
    return float("inf") if values is None else float(np.sqrt(np.mean(np.square(values))))
