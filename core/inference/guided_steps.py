"""Steps of a fit that a model of the residuals leads: how far they reach, and when it is no longer used."""

from abc import ABC, abstractmethod

import numpy as np

from ..trajectory import FloatArray

POOR = 0.2
"""Share of what was predicted below which a step's gain is poor."""


class GuidedSteps(ABC):
    """Steps to where a model of the residuals expects the least cost.

    A step fails if its gain is poor, less than is worth a simulation, or less than
    ``least_share`` of the cost. After ``patience`` failures in a row the model is no longer used. ``radius`` is the
    longest step of a coordinate.
    """

    least_share = 0.0

    def __init__(self, radius: float, patience: float) -> None:
        self.patience = patience
        self.promised = 0.0  # The gain in cost that was predicted last.
        self.expects = False  # Whether the model predicted anything when it was asked last.
        self._radius = self._reach = radius
        self._failures = 0.0

    def next(self, point: FloatArray, residual: FloatArray, cost: float, worth: float) -> FloatArray | None:
        """Where to simulate next, shape (p,); None where too little is promised, or too many steps have failed.

        ``point`` is the best one, with its residuals and cost; a gain in cost of ``worth`` is worth a simulation.
        """
        self.expects = False
        return self.at_once(point, residual, cost, worth) if self._failures < self.patience else None

    def at_once(self, point: FloatArray, residual: FloatArray, cost: float, worth: float) -> FloatArray | None:
        """The same, however many steps have failed."""
        found = self._least(point, residual, cost)
        self.expects = found is not None
        if found is None:
            return None
        there, self.promised = found
        return there if self.promised > worth else None

    def judge(
        self, here: FloatArray, there: FloatArray, residual: FloatArray | None, gained: float, cost: float, worth: float
    ) -> None:
        """Take in a step from a point of this cost to one with these residuals; None if it failed."""
        least = max(worth, POOR * self.promised, self.least_share * cost)
        self._failures = self._failures + 1 if gained <= least else 0
        if self._mispredicted(residual, gained):
            self._reach = 0.5 * float(np.max(np.abs(there - here)))
        else:
            self._reach = min(2.0 * self._reach, self._radius)

    def begin_anew(self) -> None:
        """Forget the failures."""
        self._failures = 0

    @abstractmethod
    def derivatives(self, point: FloatArray) -> FloatArray:
        """Likeliest derivatives of the residuals at a point that was simulated, shape (m, p)."""

    @abstractmethod
    def _least(self, point: FloatArray, residual: FloatArray, cost: float) -> tuple[FloatArray, float] | None:
        """Where within reach the model expects the least cost, and the gain; None if it cannot tell."""

    @abstractmethod
    def _mispredicted(self, residual: FloatArray | None, gained: float) -> bool:
        """Whether the next steps are to be shorter."""
