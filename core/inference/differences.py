"""A Jacobian by finite differences: each column asks for points until its difference will do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..trajectory import FloatArray
from .fit_settings import Box, Settings

_SMALLEST = 0.01
"""The smallest step of a difference as a share of the usual one: below it the integrator's noise shows."""

_FAR_TOO_LARGE = 5.0
"""A slope is taken again over a shorter step where the residuals changed this many times more than is needed."""

_LEAST_ROOM = 0.2
"""Share of a step that must be left before a bound, for a difference to be taken there."""


class Column:
    """Finds the derivative by one coordinate: away from the nearer bound, on the other side, and with a shorter step.

    The other side is asked for after a failure, and for a central difference; a shorter step where the residuals
    changed far more than is needed. At a knee of the voltage a percent of capacity changes it by hundreds of
    deviations, and a difference over that is off the slope by a fifth.

    ``slope`` is the norm of an older column, which sets the step; 0 if there is none. ``visible`` is the norm of the
    change over which the slope is taken; 0 always takes the usual step. ``central`` wants both sides.
    """

    def __init__(
        self,
        place: int,
        here: float,
        lower: float,
        upper: float,
        step: float,
        slope: float,
        visible: float,
        central: bool,
    ) -> None:
        self.place = place
        self._here, self._lower, self._upper, self._visible = here, lower, upper, visible
        self._smallest = _SMALLEST * step
        self._step = step
        if visible > 0 and slope * step > visible:
            self._step = max(visible / slope, self._smallest)
        self._central = central
        self._changes: dict[float, FloatArray] = {}  # By how far away.
        self._has_failed = False
        self.wanted: float | None = None  # Where the coordinate is wanted next; None when nothing more is.
        self._begin(1.0 if upper - here >= here - lower else -1.0)

    def _begin(self, first: float) -> None:
        self._sides = [first, -first]
        self._next()

    def _next(self) -> None:
        self.wanted = None
        while self._sides:
            wanted = float(np.clip(self._here + self._sides.pop(0) * self._step, self._lower, self._upper))
            if abs(wanted - self._here) >= _LEAST_ROOM * self._step:
                self.wanted = wanted
                return

    def take(self, change: FloatArray | None) -> None:
        """Note how the residuals changed; None for a simulation that failed."""
        assert self.wanted is not None
        if change is None:
            self._has_failed = True
            self._next()
            return
        away, size = self.wanted - self._here, float(np.linalg.norm(change))
        self._changes[away] = change
        if 0 < _FAR_TOO_LARGE * self._visible < size and self._step > self._smallest:
            self._changes = {away: change}  # Until there is a better one.
            self._step = max(self._step * self._visible / size, self._smallest)
            self._begin(float(np.sign(away)))
        elif self._central and len({away > 0 for away in self._changes}) == 1:
            self._next()
        else:
            self.wanted = None

    @property
    def failed(self) -> bool:
        """Whether simulations failed, and none ran that tells a slope."""
        return self._has_failed and not self._changes

    @property
    def slope(self) -> FloatArray | None:
        """The derivative of the residuals; None if nothing could be simulated."""
        near = sorted(self._changes, key=abs)[:2]
        if len(near) < 2 or near[0] * near[1] > 0:
            return self._changes[near[0]] / near[0] if near else None
        # Of the parabola through three points, whatever their distances.
        one, other = (self._changes[away] / away for away in near)
        return np.asarray((one * near[1] - other * near[0]) / (near[1] - near[0]))


class Differences:
    """Measures the derivatives of the residuals at a point, one batch of simulations after another.

    ``jacobian``, of shape (m, p), is what is known so far. The columns of coordinates that are not ``free`` stay zero,
    and so does one that cannot be measured: a fit leaves that parameter alone. ``known`` is an older Jacobian, which
    sets the steps. ``closer`` takes central differences, over a change that is smaller by `Settings.closer`.
    """

    def __init__(
        self,
        point: FloatArray,
        residual: FloatArray,
        known: FloatArray | None,
        box: Box,
        settings: Settings,
        free: NDArray[np.bool_],
        closer: bool,
    ) -> None:
        self._point, self._residual = point, residual
        self.jacobian = np.zeros((len(residual), len(point)))
        steps = np.full(len(point), settings.difference) if box.difference is None else box.difference
        if box.share is not None:
            steps = np.maximum(steps, box.share * np.abs(point))
        slopes = np.zeros(len(point)) if known is None else np.linalg.norm(known, axis=0)
        visible = settings.visible * float(np.sqrt(len(residual)))
        if closer and visible > 0:
            visible *= settings.closer
        elif closer:
            steps = settings.closer * steps
        self._columns = [
            Column(int(at), point[at], box.lower[at], box.upper[at], steps[at], slopes[at], visible, closer)
            for at in np.flatnonzero(free)
        ]

    @property
    def points(self) -> list[FloatArray]:
        """The points whose residuals are wanted next; empty when all columns are known."""
        points = []
        for column in self._columns:
            if column.wanted is not None:
                points.append(self._point.copy())
                points[-1][column.place] = column.wanted
        return points

    def take(self, residuals: Sequence[FloatArray | None]) -> None:
        """Take in the residuals of `points`, in order; None for one that failed."""
        asking = [column for column in self._columns if column.wanted is not None]
        for column, residual in zip(asking, residuals, strict=True):
            column.take(None if residual is None else residual - self._residual)
            slope = column.slope
            if slope is not None:
                self.jacobian[:, column.place] = slope

    @property
    def failed(self) -> tuple[int, ...]:
        """Places of the coordinates of which no neighbour could be simulated."""
        return tuple(column.place for column in self._columns if column.failed)

    @property
    def blocked(self) -> bool:
        """Whether neighbours failed, and none could be simulated: the Jacobian is zero, and says nothing."""
        return bool(self.failed) and all(column.slope is None for column in self._columns)
