"""The residuals around a fit: linear where the records fix the parameters, curved where they do not.

References
----------
Bates & Watts, Nonlinear Regression Analysis and Its Applications (1988), Ch. 6 and 7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .trajectory import FloatArray

BOX_VARIANCE = 1.0 / 12.0
"""Variance of an even distribution over a bounded range: what the bounds alone say of a parameter."""

_WEAK = 0.025
"""Standard deviation along a direction, in units of the box, above which the curvature of the residuals is measured."""

_MOST_DIRECTIONS = 4
"""Directions that are looked at, the weakest first: each costs two simulations."""

_BREADTH = 1.5
"""Standard deviations over which a curvature is measured: between the middle and the ends of an interval."""

_LEAST_ROOM = 0.25
"""Share of that length that must be left before a bound."""


@dataclass(frozen=True, eq=False)
class LocalModel:
    """The residuals around a candidate, in units of their standard deviation; coordinates are those of the unit box."""

    centre: FloatArray  # Where the candidate is. Shape (p,).
    residual: FloatArray  # The residuals there. Shape (m,).
    jacobian: FloatArray  # Their derivatives. Shape (m, p).
    directions: FloatArray  # Unit vectors along which the residuals are curved. Shape (q, p).
    curvature: FloatArray  # Second derivatives along them. Shape (q, m).

    @classmethod
    def straight(cls, centre: FloatArray, residual: FloatArray, jacobian: FloatArray) -> LocalModel:
        """One without curvature."""
        return cls(centre, residual, jacobian, np.zeros((0, len(centre))), np.zeros((0, len(residual))))

    def cost_function(self, dispersion: float = 1.0) -> Callable[[FloatArray], FloatArray]:
        """Sums of squares over the dispersion at points of shape (n, p), shape (n,); quick for many points."""
        # The triangular factor has the same sums of squares in a few rows.
        factor = np.linalg.qr(self._columns, mode="r") / np.sqrt(dispersion)
        return lambda points: np.asarray(np.sum((self._terms(points) @ factor.T) ** 2, axis=1))

    def residual_at(self, point: FloatArray) -> FloatArray:
        """The residuals at a point of shape (p,), shape (m,)."""
        return np.asarray(self._columns @ self._terms(point[None, :])[0])

    def linear_estimate(self, dispersion: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the posterior without curvature or bounds, the box counting by its variance."""
        information = self.jacobian.T @ self.jacobian / dispersion + np.eye(len(self.centre)) / BOX_VARIANCE
        covariance: FloatArray = np.asarray(np.linalg.inv(information), dtype=np.float64)
        mean: FloatArray = self.centre - covariance @ self.jacobian.T @ self.residual / dispersion
        return mean, covariance

    def probes(self) -> list[tuple[FloatArray, float]]:
        """Where residuals are needed to measure their curvature: unit vectors of weak directions, and step lengths.

        Forwards and backwards along each, as far as the bounds allow; a side without room is left out.
        """
        variances, directions = np.linalg.eigh(self.linear_estimate()[1])
        weak = [place for place in np.argsort(-variances) if np.sqrt(variances[place]) > _WEAK][:_MOST_DIRECTIONS]
        wanted = []
        for place in weak:
            direction, length = directions[:, place], _BREADTH * float(np.sqrt(variances[place]))
            for side in (1.0, -1.0):
                step = min(length, self._room(side * direction))
                if step > _LEAST_ROOM * length:
                    wanted.append((direction, side * step))
        return wanted

    def _room(self, direction: FloatArray) -> float:
        """Longest step along a direction inside the box."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(direction > 0, (1.0 - self.centre) / direction, -self.centre / direction)
        return float(np.min(ends[np.abs(direction) > 0]))

    def with_curvature(
        self, probes: Sequence[tuple[FloatArray, float]], changes: Sequence[FloatArray | None]
    ) -> LocalModel:
        """The same with what probes have shown.

        Parameters
        ----------
        probes : sequence of tuple
            As `probes` gave them.
        changes : sequence of ndarray of shape (m,) or None
            Residuals at each, less those at the centre; None for one that failed.
        """
        jacobian, directions, curvature = self.jacobian.copy(), [], []
        seen = [
            (direction, step, change)
            for (direction, step), change in zip(probes, changes, strict=True)
            if change is not None
        ]
        for direction in _distinct([direction for direction, _, _ in seen]):
            own = [(step, change) for along, step, change in seen if along is direction]
            slope = jacobian @ direction
            if len(own) == 2:
                # A parabola through three points: its slope stands for more than a short difference does.
                (one, first), (other, second) = own
                slope = (first * other**2 - second * one**2) / (one * other * (other - one))
                jacobian += np.outer(slope - jacobian @ direction, direction)
            step, change = own[0]
            directions.append(direction)
            curvature.append(2.0 * (change - step * slope) / step**2)
        if not directions:
            return self
        return replace(self, jacobian=jacobian, directions=np.array(directions), curvature=np.array(curvature))

    @property
    def _columns(self) -> FloatArray:
        return np.column_stack([self.residual, self.jacobian, 0.5 * self.curvature.T])

    def _terms(self, points: FloatArray) -> FloatArray:
        moved = points - self.centre
        return np.column_stack([np.ones(len(points)), moved, (moved @ self.directions.T) ** 2])


def _distinct(directions: Sequence[FloatArray]) -> list[FloatArray]:
    """Each array once, by identity."""
    return list({id(direction): direction for direction in directions}.values())
