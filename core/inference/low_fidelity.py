"""A low-fidelity model that leads a fit: a coarse mesh, or a reduced-order model, corrected by what it is off.

Such a model is off by far more than a fit ends at, but by nearly the same at neighbouring points. A fit of the
corrected model, which takes a share of the time, so leads near to where the fit of the full one ends. How far the model
is off, and how that changes, is learnt from the points that both have simulated, by Broyden's updates.

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
"""Share of the cost to which the first fit of the corrected model goes: what it is off elsewhere is not known yet."""

_OF_SURPRISE = _OF_COST = 0.1
"""Shares of the squared error of the last prediction, and of the cost, to the lower of which later ones go."""


class LowFidelity:
    """A low-fidelity model, corrected so that it agrees with the full one where both have simulated.

    Parameters
    ----------
    residuals : callable
        Residuals of points by the low-fidelity model.
    suffices : bool
        Whether a fit ends where this model leads no further. If not, it goes on without this model.

    Attributes
    ----------
    jacobian : ndarray of shape (m, p) or None
        What is known of the corrected model's derivatives near the last point.
    """

    def __init__(self, residuals: LowResiduals, suffices: bool = False) -> None:
        self._simulate = residuals
        self.suffices = suffices
        self._seen: dict[bytes, FloatArray | None] = {}
        self._learnt: set[bytes] = set()  # Where the full model has simulated too.
        self._point = self._off = np.zeros(0)  # How far the model is off at a point.
        self._correction: FloatArray | None = None  # How that changes.
        self._surprise: float | None = None  # Squared error of the last prediction.
        self.jacobian: FloatArray | None = None

    def learn(self, point: FloatArray, residual: FloatArray | None) -> bool:
        """Take in a simulation of the full model; whether the low-fidelity model could be simulated there too.

        The residual is None where the full model failed. The correction is centred on the point.
        """
        here = None if residual is None else self._low([point])[0]
        if residual is None or here is None:
            return False
        off = residual - here
        if self._correction is None:
            self._correction = np.zeros((len(off), len(point)))
        elif point.tobytes() not in self._learnt:
            moved = point - self._point
            surprise = off - self._off - self._correction @ moved
            self._surprise = float(surprise @ surprise)
            self._correct(np.outer(surprise, moved) / float(moved @ moved))
        self._learnt.add(point.tobytes())
        self._point, self._off = point, off
        return True

    def corrected(self, points: Sequence[FloatArray]) -> list[FloatArray | None]:
        """Residuals by the corrected model; None for a point that failed."""
        assert self._correction is not None
        return [
            None if low is None else low + self._off + self._correction @ (point - self._point)
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
        return _FIRST * cost if self._surprise is None else min(_OF_SURPRISE * self._surprise, _OF_COST * cost)

    def weigh_anew(self, factor: float) -> None:
        """Note that residuals are multiplied by a factor from now on."""
        self._off = factor * self._off
        self._seen = {place: None if seen is None else factor * seen for place, seen in self._seen.items()}
        self._correction = None if self._correction is None else factor * self._correction
        self._surprise = None if self._surprise is None else factor**2 * self._surprise
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
