"""How a least-squares fit proceeds, and between which bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..trajectory import FloatArray


@dataclass(frozen=True)
class Settings:
    """How a fit proceeds; lengths are in units of the coordinates."""

    # Finite-difference step. Integrators leave noise: at a relative tolerance of 1e-5, steps well below 0.005 of a
    # parameter's range measure the noise instead.
    difference: float = 0.007
    radius: float = 0.3  # Longest step of a coordinate.
    damping: float = 1e-5  # Of the first step, relative to the squared norm of each column.
    # Standard deviation of a residual. A gain in cost below its square says nothing about the parameters, and a fit
    # goes on until no more is predicted.
    noise: float = 0.0
    # Share of the cost that must be gained to be worth a step, where that is more than the noise.
    tolerance: float = 1e-3
    enough: float = 0.0  # Root mean square of the residuals at which the fit is as good as perfect.
    # Root mean square change of the residuals over which a slope is taken, where an older Jacobian tells it; 0 always
    # takes ``difference``.
    visible: float = 0.0
    # Share of that change, or of the step, for Jacobians by central differences, which are taken where steps on an
    # ordinary one gain nothing although more is predicted; 0 for none. In a valley that bends they go on, at twice the
    # price.
    closer: float = 0.0
    # Whether the last Jacobian must have been taken at the best point, whatever the steps before it gained.
    ends_on_fresh: bool = False
    # Whether steps by an emulator, learnt from every simulation, come before another Jacobian (`EmulatedSteps`).
    emulates: bool = False
    # How far to either side of its start a fit of the low-fidelity model begins again where it is in a local minimum; 0
    # where it does not.
    elsewhere: float = 0.0


@dataclass(frozen=True, eq=False)
class Box:
    """The coordinates of a fit, each array of shape (p,)."""

    # lower, upper: Bounds.
    lower: FloatArray
    upper: FloatArray
    # Cost of a unit of each coordinate: ``(prior x)^2`` is added to the sum of squares; 0 for no prior.
    prior: FloatArray
    difference: FloatArray | None = None  # Finite-difference steps, where they are not all that of the settings.
    # Finite-difference steps as shares of the coordinates' size, where these are longer.
    share: FloatArray | None = None

    @classmethod
    def unit(cls, count: int) -> Box:
        """The unit box, without priors (see `ParameterSpace.to_unit`)."""
        return cls(np.zeros(count), np.ones(count), np.zeros(count))

    def beside(self, point: FloatArray, far: float) -> list[FloatArray]:
        """Points inside the bounds that differ from one in a single coordinate, by so much to either side."""
        steps = far * np.eye(len(point))
        return [np.clip(point + step, self.lower, self.upper) for step in (*steps, *-steps)]

    def cost(self, point: FloatArray, residual: FloatArray) -> float:
        """Sum of squares of the residuals at a point, the price of departing from the prior included."""
        departure = self.prior * point
        return float(residual @ residual) + float(departure @ departure)
