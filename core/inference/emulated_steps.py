"""Steps of a fit by an emulator of its residuals, which is learnt from every simulation that was made.

A linear model has the slopes at one point. In a narrow valley that bends its steps are short, and after a few of them
a new Jacobian is needed. A Gaussian process through all simulations has the change of the slopes too, and estimates its
own error.

References
----------
Jones, Schonlau & Welch, J. Global Optim. 13 (1998) 455; and those of `emulator`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ..comparison.robust_loss import robust
from ..prior import EVEN
from ..threads import on_one_thread
from ..trajectory import FloatArray
from .emulator import Emulator, learn
from .fit_settings import Box
from .guided_steps import GuidedSteps

_PATIENCE, _PRICE = 3, 0.25
"""Steps in a row that may fail before a new Jacobian: at least so many, and this share of the number of simulations
that a Jacobian takes. Twice as many change little on measured cells."""

_MOST = 250
"""Simulations that the emulator learns from at most, the best ones: its time grows with their third power."""

_FAR = 20.0
"""In units of the root mean square at the best point: larger residuals count by their order of magnitude, and
simulations with a larger root mean square are left out, as too far from the fit to tell of its neighbourhood."""


class EmulatedSteps(GuidedSteps):
    """Remembers the simulations of a fit, and leads to where an emulator expects the least cost.

    ``noise`` is the standard deviation of a residual; 0 takes residuals as they are.
    """

    def __init__(self, box: Box, free: NDArray[np.bool_], noise: float, radius: float = np.inf) -> None:
        super().__init__(radius, max(_PATIENCE, _PRICE * np.count_nonzero(free)))
        self._free, self._noise = free, noise or 1.0
        self._lower, self._upper = box.lower, box.upper
        self._prior = box.prior / self._noise
        wide = np.where(box.upper > box.lower, box.upper - box.lower, 1.0)
        self._stretch = np.where(box.prior > 0.0, EVEN * self._prior, 1.0 / wide)
        self._origin = np.where(box.prior > 0.0, 0.5, -box.lower / wide)
        self._points: list[FloatArray] = []
        self._residuals: list[FloatArray] = []
        self._learnt = 0
        self._rows = np.zeros(0, dtype=np.bool_)
        self._emulator: Emulator | None = None

    def remember(self, point: FloatArray, residual: FloatArray | None) -> None:
        """Take in a simulation; None for one that failed, of which nothing is learnt."""
        if residual is not None:
            self._points.append(np.asarray(point, dtype=np.float64))
            self._residuals.append(np.asarray(residual, dtype=np.float64))

    @property
    def known(self) -> int:
        """How many simulations it knows."""
        return len(self._points)

    @on_one_thread
    def step(self, point: FloatArray, radius: float) -> tuple[FloatArray, float]:
        """A step of shape (p,) from a point to where the least cost is expected, and the gain.

        ``radius`` is the longest step of a coordinate.
        """
        self._learn()
        lower = np.maximum(self._lower, point - radius)[self._free]
        upper = np.minimum(self._upper, point + radius)[self._free]
        bounds = np.stack([lower, upper], axis=1)
        here, _ = self._cost(point[self._free], point)
        found = minimize(self._cost, point[self._free], (point,), "L-BFGS-B", jac=True, bounds=bounds)
        step = np.zeros(len(point))
        step[self._free] = np.clip(found.x, lower, upper) - point[self._free]
        return step, (here - float(found.fun)) * self._noise**2

    def judge(
        self, here: FloatArray, there: FloatArray, residual: FloatArray | None, gained: float, cost: float, worth: float
    ) -> None:
        """See `GuidedSteps.judge`."""
        super().judge(here, there, residual, gained, cost, worth)
        if residual is None:
            # An emulator learns nothing from a failure, and would propose the same point.
            self._failures = self.patience

    def _least(self, point: FloatArray, residual: FloatArray, cost: float) -> tuple[FloatArray, float]:
        step, gain = self.step(point, self._reach)
        return np.clip(point + step, self._lower, self._upper), gain

    def _mispredicted(self, residual: FloatArray | None, gained: float) -> bool:
        return residual is None

    @on_one_thread
    def derivatives(self, point: FloatArray) -> FloatArray:
        """Likeliest derivatives of the residuals at a point, shape (m, p); those of fixed coordinates are zero."""
        self._learn()
        assert self._emulator is not None
        found = np.zeros((len(self._rows), len(point)))
        found[self._rows] = self._emulator.derivatives(self._places(point)) * self._stretch * self._noise
        return np.where(self._free, found, 0.0)

    def _learn(self) -> None:
        if self._learnt == len(self._points):
            return
        self._learnt = len(self._points)
        points, found = np.array(self._points), np.array(self._residuals) / self._noise
        self._rows = np.any(found != 0.0, axis=0)
        size = np.sqrt(np.mean(found**2, axis=1))
        scale = max(float(size.min()), 1.0)
        used = [place for place in np.argsort(size, kind="stable")[:_MOST] if size[place] <= _FAR * scale]
        near = scale * robust(found[used][:, self._rows] / scale, _FAR)
        self._emulator = learn(self._places(points[used]), near, self._emulator)

    def _cost(self, moved: FloatArray, base: FloatArray) -> tuple[float, FloatArray]:
        """Expected cost, that of the prior included, in squared deviations, and its derivatives."""
        assert self._emulator is not None
        point = base.copy()
        point[self._free] = moved
        value, slopes = self._emulator.expected_cost(self._places(point))
        off = self._prior * point
        return value + float(off @ off), (slopes * self._stretch + 2.0 * self._prior * off)[self._free]

    def _places(self, points: FloatArray) -> FloatArray:
        """Points in the emulator's coordinates, in which each prior is as wide as a uniform one over the unit box."""
        return np.asarray(self._origin + points * self._stretch)
