"""How far a cycle's capacity may lie from the simulated one: what the fitted parameters leave open, and scatter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..normal import NORMAL_95
from ..trajectory import FloatArray

CAPACITY = "capacity"
"""What errors and bands of a life's capacity are called."""


@dataclass(frozen=True)
class FadeBand:
    """The 95 % band of the capacity of single cycles."""

    cycle: tuple[float, ...]
    half_ah: tuple[float, ...]  # Half its width, A.h; of the parameters, and of the scatter of cycles about the fit.

    @classmethod
    def propagated(
        cls, cycle: FloatArray, jacobian: FloatArray, covariance: Sequence[Sequence[float]], scatter_ah: float
    ) -> FadeBand:
        """The band of capacities whose derivatives in the unit box, A.h, have shape (n, p)."""
        variance = np.einsum("ij,jk,ik->i", jacobian, np.asarray(covariance, dtype=np.float64), jacobian)
        half = NORMAL_95 * np.sqrt(np.maximum(variance, 0.0) + scatter_ah**2)
        return cls(tuple(map(float, cycle)), tuple(map(float, half)))

    def at(self, cycles: FloatArray) -> FloatArray:
        """Half its width at other cycles, linear between the known ones, A.h."""
        return np.asarray(np.interp(cycles, self.cycle, self.half_ah))
