"""What is known of the parameters before a fit, as distances from it in the unit box."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from .parameters import ParameterSpace
from .trajectory import FloatArray

_FARTHEST = 4.0
"""Largest coordinate of `Prior.normal`, in standard deviations: it leaves out a part in 30,000 of a uniform range at
each bound."""

EVEN = 12.0**-0.5
"""Standard deviation of an even distribution over the box."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent normal distributions over coordinates of the unit box, each array of shape (p,)."""

    centre: FloatArray
    precision: FloatArray  # Reciprocal standard deviations; 0 for none, where every value is as likely.

    @classmethod
    def of(cls, space: ParameterSpace, weighed: bool = True) -> Prior:
        """The priors of a search space; none where the search did not weigh them."""
        precision = space.prior_weights * (space.highest - space.lowest)
        centre = space.to_unit({parameter.name: parameter.origin for parameter in space})
        return cls(centre, precision if weighed else np.zeros(len(space)))

    def deviations(self, points: FloatArray) -> FloatArray:
        """Standard deviations by which points of shape (..., p) depart from the centre, the same shape."""
        return np.asarray(self.precision * (points - self.centre))

    def residuals(self, residual: FloatArray, point: FloatArray, scale: float = 1.0) -> FloatArray:
        """Residuals at a point, followed by those of the prior, in units of 1/scale of a standard deviation."""
        return np.concatenate([residual, scale * self.deviations(point)])

    def jacobian(self, jacobian: FloatArray, scale: float = 1.0) -> FloatArray:
        """The derivatives of `residuals`."""
        return np.vstack([jacobian, scale * np.diag(self.precision)])

    def normal(self, points: FloatArray) -> FloatArray:
        """Coordinates in which the prior, cut at the bounds, is standard normal; of points of shape (..., p)."""
        below, within = self._shares
        share = np.where(self._known, (ndtr(self.deviations(points)) - below) / within, points)
        return np.asarray(np.clip(ndtri(np.clip(share, 0.0, 1.0)), -_FARTHEST, _FARTHEST))

    def unit(self, normal: FloatArray) -> FloatArray:
        """The inverse of `normal`: points of the unit box."""
        below, within = self._shares
        share = ndtr(normal)
        found = self.centre + ndtri(np.where(self._known, below + within * share, 0.5)) / self._precision
        return np.asarray(np.clip(np.where(self._known, found, share), 0.0, 1.0))

    def slopes(self, normal: FloatArray) -> FloatArray:
        """Derivatives of `unit`, the same shape."""
        _, within = self._shares
        off = np.where(self._known, self.deviations(self.unit(normal)), 0.0)
        steepness = np.where(self._known, within / self._precision, (2.0 * np.pi) ** -0.5)
        return np.asarray(steepness * np.exp(0.5 * (off**2 - normal**2)))

    def as_wide_as_the_box(self, points: FloatArray) -> FloatArray:
        """Points of shape (..., p) in coordinates in which each prior is as wide as a uniform one over the unit box."""
        return np.where(self._known, 0.5 + EVEN * self.deviations(points), points)

    @cached_property
    def _known(self) -> NDArray[np.bool_]:
        return np.asarray(self.precision > 0.0)

    @cached_property
    def _precision(self) -> FloatArray:
        return np.where(self._known, self.precision, 1.0)

    @cached_property
    def _shares(self) -> tuple[FloatArray, FloatArray]:
        """Of each normal distribution the share below the box, and within."""
        below = ndtr(-self.centre * self._precision)
        return below, ndtr((1.0 - self.centre) * self._precision) - below
