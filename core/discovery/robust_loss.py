"""Errors that are too large to be weighed by their square."""

from __future__ import annotations

import numpy as np

from ..trajectory import FloatArray

_FAR_V = 0.1
"""Errors beyond this are drawn in."""


def robust(error: FloatArray) -> FloatArray:
    """Errors (V) with those beyond a tenth of a volt drawn in: ``s arcsinh(e / s)``.

    A candidate whose cell is empty before its record ends is volts off, and how many samples it is off by would
    outweigh everything else that a fit could learn.
    """
    return np.asarray(_FAR_V * np.arcsinh(error / _FAR_V))
