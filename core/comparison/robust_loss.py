"""Errors that are too large to be weighed by their square."""

import numpy as np

from ..trajectory import FloatArray

FAR_V = 0.1
"""Errors of a voltage beyond this count as far."""


def robust(errors: FloatArray, far: float = FAR_V) -> FloatArray:
    """Errors with those beyond ``far`` reduced to their order of magnitude: ``far arcsinh(e / far)``.

    A candidate whose cell is empty before its record ends is off by volts there, and these samples would outweigh all
    others. ``far`` is in the unit of the errors; by default for voltages.
    """
    return np.asarray(far * np.arcsinh(errors / far))
