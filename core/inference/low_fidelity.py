"""A low-fidelity model that leads a fit: a coarse mesh, or a reduced-order model, corrected by its error.

The error of such a model is far larger than the misfit that a fit ends at, but nearly the same at neighbouring points.
A fit of the corrected model takes a share of the time, and ends near to where the fit of the full one does. The error,
and how it changes, is learnt from the points that both models have simulated, by Broyden's updates.

References
----------
Bandler et al., IEEE Trans. Microw. Theory Tech. 43 (1995) 2874 (aggressive space mapping). Alexandrov et al., J.
Aircraft 38 (2001) 1093 (approximation management).
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..trajectory import FloatArray

LowResiduals = Callable[[Sequence[FloatArray]], Sequence[FloatArray | None]]
"""Residuals of points of shape (p,) by a low-fidelity model, each of shape (m,); None for one that failed."""

_FIRST = 0.01
"""Share of the cost to which the first fit of the corrected model goes: its error elsewhere is not known yet."""

_OF_ERROR = _OF_COST = 0.1
"""Shares of the squared error of the last prediction, and of the cost, to the lower of which later ones go."""


class LowFidelity:
    """A low-fidelity model, corrected so that it agrees with the full one where both have simulated.

    Parameters
    ----------
    residuals : callable
        Residuals of points by the low-fidelity model.
    suffices : bool
        Whether a fit ends where this model leads no further. If not, it goes on without this model.
    """

    def __init__(self, residuals: LowResiduals, suffices: bool = False) -> None:
        self._simulate = residuals
        self.suffices = suffices
        self.has_led = False  # Whether a step by this model has gained anything, in any fit that it has led.
        self._seen: dict[bytes, FloatArray | None] = {}
        self._learnt: set[bytes] = set()  # Where the full model has simulated too.
        self._point = self._error = np.zeros(
            0
        )  # What the full model's residuals are less those of this one, at a point.
        self._correction: FloatArray | None = None  # Derivatives of that error.
        self._missed: float | None = None  # Squared error of the last prediction.
        # What is known of the corrected model's derivatives near the last point, shape (m, p).
        self.jacobian: FloatArray | None = None

    def learn(self, point: FloatArray, residual: FloatArray | None) -> bool:
        """Take in a simulation of the full model; whether the low-fidelity model could be simulated there too.

        The residual is None where the full model failed. The correction is centred on the point.
        """
        here = None if residual is None else self._low([point])[0]
        if residual is None or here is None:
            return False
        error = residual - here
        if self._correction is None:
            self._correction = np.zeros((len(error), len(point)))
        elif point.tobytes() not in self._learnt:
            moved = point - self._point
            missed = error - self._error - self._correction @ moved
            self._missed = float(missed @ missed)
            self._correct(np.outer(missed, moved) / float(moved @ moved))
        self._learnt.add(point.tobytes())
        self._point, self._error = point, error
        return True

    def corrected(self, points: Sequence[FloatArray]) -> list[FloatArray | None]:
        """Residuals by the corrected model; None for a point that failed."""
        assert self._correction is not None
        return [
            None if low is None else low + self._error + self._correction @ (point - self._point)
            for point, low in zip(points, self._low(points), strict=True)
        ]

    @property
    def known(self) -> list[tuple[FloatArray, FloatArray]]:
        """Points other than the last one, with their residuals by the corrected model, that take no simulation."""
        points = [np.frombuffer(place) for place, seen in self._seen.items() if seen is not None]
        away = [point for point in points if not np.array_equal(point, self._point)]
        return [(point, found) for point, found in zip(away, self.corrected(away), strict=True) if found is not None]

    def worth(self, cost: float) -> float:
        """The cost to which a fit of the corrected model is worth its simulations, from the cost where it begins."""
        return _FIRST * cost if self._missed is None else min(_OF_ERROR * self._missed, _OF_COST * cost)

    def weigh_anew(self, factor: float) -> None:
        """Note that residuals are multiplied by a factor from now on."""
        self._error = factor * self._error
        self._seen = {place: None if seen is None else factor * seen for place, seen in self._seen.items()}
        self._correction = None if self._correction is None else factor * self._correction
        self._missed = None if self._missed is None else factor**2 * self._missed
        self.jacobian = None if self.jacobian is None else factor * self.jacobian

    def _correct(self, change: FloatArray) -> None:
        assert self._correction is not None
        self._correction = self._correction + change
        if self.jacobian is not None:
            self.jacobian = self.jacobian + change

    def _low(self, points: Sequence[FloatArray]) -> list[FloatArray | None]:
        """Residuals by the low-fidelity model as it is, each point simulated once."""
        new = {point.tobytes(): point for point in points if point.tobytes() not in self._seen}
        if new:
            self._seen |= dict(zip(new, self._simulate(list(new.values())), strict=True))
        return [self._seen[point.tobytes()] for point in points]
