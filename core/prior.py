"""What is known of the parameters before a fit, as distances from it in the unit box."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .identifiability import BOX_VARIANCE
from .parameters import ParameterSpace
from .trajectory import FloatArray


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent normal distributions over coordinates of the unit box, each array of shape (p,)."""

    centre: FloatArray
    precision: FloatArray  # Reciprocal standard deviations; 0 for none, where every value is as likely.

    @classmethod
    def of(cls, space: ParameterSpace, weighed: bool = True) -> Prior:
        """The priors of a search space; none where the search did not weigh them."""
        precision = space.prior_weights * (space.highest - space.lowest)
        return cls(space.to_unit(space.initial), precision if weighed else np.zeros(len(space)))

    def about(self, point: FloatArray) -> Prior:
        """The same, and about a point what the bounds alone say of coordinates without a prior."""
        known = self.precision > 0.0
        return replace(
            self,
            centre=np.where(known, self.centre, point),
            precision=np.where(known, self.precision, BOX_VARIANCE**-0.5),
        )

    def deviations(self, points: FloatArray) -> FloatArray:
        """Standard deviations by which points of shape (..., p) depart from the centre, the same shape."""
        return np.asarray(self.precision * (points - self.centre))

    def residuals(self, residual: FloatArray, point: FloatArray, scale: float = 1.0) -> FloatArray:
        """Residuals at a point with those of the prior behind them, in units of 1/scale of a standard deviation."""
        return np.concatenate([residual, scale * self.deviations(point)])

    def jacobian(self, jacobian: FloatArray, scale: float = 1.0) -> FloatArray:
        """The derivatives of `residuals`."""
        return np.vstack([jacobian, scale * np.diag(self.precision)])
