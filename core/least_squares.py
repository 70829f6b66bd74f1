"""Bounded least squares for expensive, noisy simulations: Levenberg-Marquardt with Broyden's updates.

Every number is a coordinate of the unit box (`ParameterSpace.to_unit`). Derivatives are finite differences,
asked for as one batch that can be simulated side by side. Between them the Jacobian learns from each
step by Broyden's rank-one update, which costs nothing. A candidate that fails to simulate only makes
the next step shorter.

References
----------
Levenberg, Quart. Appl. Math. 2 (1944) 164. Marquardt, SIAM J. Appl. Math. 11 (1963) 431. Broyden, Math.
Comp. 19 (1965) 577. Nocedal & Wright, Numerical Optimization, 2nd ed. (2006), Ch. 4, 10 and 11.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .bounded_step import bounded_step
from .errors import BsaError
from .parameters import Candidate, ParameterSpace
from .trajectory import FloatArray

Stage = Literal["start", "jacobian", "other side", "step", "done"]

_GOOD, _POOR = 0.75, 0.25
"""Actual over predicted reduction: above the first the radius grows, below the second it shrinks."""

_AFTER_FAILURE = 0.35
"""Share of a failed step that is tried next."""

_SLOW = 0.1
"""A step that takes less than this share off the cost asks for a better Jacobian, if one can be had."""

_RESTORED = 0.25
"""Share of the first radius to which a new Jacobian opens the radius again."""

_POOR_STEPS = 2
"""Disappointing steps in a row before the Jacobian is taken anew."""

_FORETOLD = 1e-6
"""Squared error of the model's last prediction, relative to the cost, below which the model is not in doubt."""

_EXACT = 1e-24
"""Cost relative to the first at which nothing is left to fit."""


@dataclass(frozen=True)
class Settings:
    """How a fit proceeds; lengths are in units of the box.

    Attributes
    ----------
    difference : float
        Finite-difference step. Integrators leave noise: at a relative tolerance of 1e-5, steps well below
        0.005 measure the noise instead.
    radius : float
        Longest first step.
    largest_radius, smallest_radius : float
        Limits of the trust radius; a fit whose steps would be shorter than the smallest has converged.
    tolerance : float
        A round (a Jacobian and the steps it carried) that takes less than this share off the cost is the last.
    enough : float
        Root mean square of the residuals at which the fit is as good as perfect.
    """

    difference: float = 0.007
    radius: float = 0.3
    largest_radius: float = 1.0
    smallest_radius: float = 1e-4
    tolerance: float = 1e-3
    enough: float = 0.0


class LeastSquares:
    """Minimises ``||r(x)||`` over the unit box by asking for residuals and being told them.

    Parameters
    ----------
    start : ndarray of shape (p,)
        Where to begin.
    residual : ndarray of shape (m,), optional
        The residuals there, if they are known already.
    settings : Settings, optional
        How to proceed.
    free : ndarray of bool, shape (p,), optional
        Which coordinates may move; all by default.
    jacobian : ndarray of shape (m, p), optional
        What is believed of the derivatives; taken anew when it disappoints.

    Notes
    -----
    Deterministic: the same answers lead to the same questions. `ask` repeats itself until it is told.
    """

    def __init__(
        self,
        start: FloatArray,
        residual: FloatArray | None = None,
        settings: Settings | None = None,
        free: NDArray[np.bool_] | None = None,
        jacobian: FloatArray | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self._point = np.clip(np.asarray(start, dtype=np.float64), 0.0, 1.0)
        self._free = np.ones(len(self._point), dtype=bool) if free is None else np.asarray(free, dtype=bool)
        self._radius = self.settings.radius
        self._residual = residual
        self._jacobian = None if jacobian is None else jacobian.copy()
        self._stale = jacobian is not None
        self._moved = jacobian is not None
        self._poor_steps = 0
        self._foretold = False
        self._batch: list[FloatArray] = []
        self._columns: list[int] = []
        self.simulations = 0
        self.converged = False
        self._stage: Stage = "start"
        if residual is not None:
            self._first_cost = self._round_cost = _cost(residual)
            self._stage = "jacobian" if jacobian is None else "step"

    @property
    def point(self) -> FloatArray:
        """The best point found, shape (p,)."""
        return self._point

    @property
    def residual(self) -> FloatArray | None:
        """The residuals at the best point, shape (m,); None if the start failed."""
        return self._residual

    @property
    def jacobian(self) -> FloatArray | None:
        """What is believed of the derivatives at the best point, shape (m, p); None before the first batch."""
        return self._jacobian

    @property
    def cost(self) -> float:
        """Sum of squares at the best point; infinite if the start failed."""
        return float("inf") if self._residual is None else _cost(self._residual)

    @property
    def radius(self) -> float:
        """How far the linear model is trusted."""
        return self._radius

    @property
    def round_gain(self) -> float:
        """Share of the cost that the steps since the last Jacobian took off."""
        return 1.0 - self.cost / self._round_cost if self._residual is not None and self._round_cost > 0 else 0.0

    @property
    def stage(self) -> Stage:
        """What the next batch is for."""
        return self._stage

    @property
    def done(self) -> bool:
        """Whether nothing is left to ask: converged, or no point near the best one simulates."""
        return self._stage == "done"

    def ask(self, limit: int | None = None) -> list[FloatArray]:
        """The points whose residuals are wanted next, each of shape (p,) inside the box; empty when done.

        Parameters
        ----------
        limit : int, optional
            How many can still be simulated. Where they do not suffice for a new Jacobian, the one at
            hand is used to the end.
        """
        if self._batch:
            return [point.copy() for point in self._batch]
        if self._stage == "jacobian" and self._jacobian is not None and limit is not None and limit <= self._free.sum():
            self._stage = "step"
        if self._stage == "start":
            self._batch = [self._point]
        elif self._stage == "jacobian":
            self._columns = [int(column) for column in np.flatnonzero(self._free)]
            self._batch = [self._differing(column, self._side(column)) for column in self._columns]
        elif self._stage == "step":
            self._batch = self._step()
        if not self._batch:
            self._stage = "done"
        return [point.copy() for point in self._batch]

    def tell(self, residuals: Sequence[FloatArray | None]) -> None:
        """Take in the residuals of the batch, in order; None for a point that failed to simulate.

        Raises
        ------
        BsaError
            If their number is not that of the points asked for.
        """
        if len(residuals) != len(self._batch):
            raise BsaError(f"{len(self._batch)} points were asked for, but {len(residuals)} residuals were told.")
        self.simulations += len(residuals)
        usable = [value if value is not None and np.all(np.isfinite(value)) else None for value in residuals]
        batch, self._batch = self._batch, []
        if self._stage == "start":
            self._take_start(usable[0])
        elif self._stage == "step":
            self._take_step(batch[0], usable[0])
        else:
            self._take_differences(batch, usable)

    def _take_start(self, residual: FloatArray | None) -> None:
        self._residual = residual
        if residual is None:
            self._stage = "done"
            return
        self._first_cost = self._round_cost = _cost(residual)
        self._stage = "jacobian"

    def _side(self, column: int) -> float:
        """Away from the nearer bound, so that there is always room."""
        return 1.0 if self._point[column] <= 0.5 else -1.0

    def _differing(self, column: int, side: float) -> FloatArray:
        point = self._point.copy()
        point[column] = np.clip(point[column] + side * self.settings.difference, 0.0, 1.0)
        return point

    def _take_differences(self, batch: list[FloatArray], residuals: list[FloatArray | None]) -> None:
        assert self._residual is not None
        if self._stage == "jacobian":
            # A column that cannot be measured stays zero: that parameter is left alone this time.
            self._jacobian = np.zeros((len(self._residual), len(self._point)))
        assert self._jacobian is not None
        failed: list[int] = []
        for column, point, residual in zip(self._columns, batch, residuals, strict=True):
            change = point[column] - self._point[column]
            if residual is None or change == 0.0:
                failed.append(column)
            else:
                self._jacobian[:, column] = (residual - self._residual) / change
        if failed and self._stage == "jacobian":
            self._stage, self._columns = "other side", failed
            self._batch = [self._differing(column, -self._side(column)) for column in failed]
            return
        self._stale, self._moved, self._foretold, self._poor_steps = False, False, False, 0
        self._round_cost = self.cost
        self._stage = "step"

    def _step(self) -> list[FloatArray]:
        assert self._jacobian is not None
        assert self._residual is not None
        lower = np.where(self._free, -self._point, 0.0)
        upper = np.where(self._free, 1.0 - self._point, 0.0)
        step = bounded_step(self._jacobian, self._residual, lower, upper, self._radius)
        expected = _cost(self._residual) - _cost(self._residual + self._jacobian @ step)
        if self._perfect() or expected <= self.settings.tolerance * 0.1 * self.cost:
            return self._nothing_left()
        return [np.clip(self._point + step, 0.0, 1.0)]

    def _nothing_left(self) -> list[FloatArray]:
        """The linear model sees nothing to gain: look again if it may be wrong, else stop."""
        if self._moved and not self._perfect() and not self._round_was_idle():
            self._stage = "jacobian"
            return self.ask()
        self.converged = True
        return []

    def _perfect(self) -> bool:
        assert self._residual is not None
        return self.cost <= max(_EXACT * self._first_cost, len(self._residual) * self.settings.enough**2)

    def _round_was_idle(self) -> bool:
        return self._foretold or self.cost > (1.0 - self.settings.tolerance) * self._round_cost

    def _take_step(self, point: FloatArray, residual: FloatArray | None) -> None:
        assert self._residual is not None
        assert self._jacobian is not None
        step = point - self._point
        length = float(np.linalg.norm(step))
        before = self.cost
        if residual is None:
            self._radius = _AFTER_FAILURE * length
            self._poor_steps += 1
        else:
            model = self._residual + self._jacobian @ step
            gained = before - _cost(residual)
            ratio = gained / max(before - _cost(model), 1e-300)
            self._resize(ratio, length)
            self._poor_steps = self._poor_steps + 1 if ratio < _POOR or gained < _SLOW * before else 0
            # Far away a rejected point says little of the slope here, if that was measured here.
            if gained > 0 or self._stale:
                self._jacobian += np.outer(residual - model, step) / length**2
                self._stale = True
            if gained > 0:
                self._point, self._residual, self._moved = point, residual, True
                self._foretold = _cost(residual - model) <= _FORETOLD * self.cost
        self._next_stage()

    def _resize(self, ratio: float, length: float) -> None:
        if ratio < _POOR:
            self._radius = _POOR * length if ratio < 0 else 0.5 * length
        elif ratio > _GOOD and length > 0.8 * self._radius:
            self._radius = min(2.0 * self._radius, self.settings.largest_radius)

    def _next_stage(self) -> None:
        if self._radius < self.settings.smallest_radius and not self._moved:
            self.converged = True
            self._stage = "done"
        elif self._moved and (self._poor_steps >= _POOR_STEPS or self._radius < self.settings.smallest_radius):
            if self._round_was_idle():
                self.converged = True
                self._stage = "done"
                return
            # It was the Jacobian that disappointed, perhaps not the length of the steps.
            self._radius = max(self._radius, _RESTORED * self.settings.radius)
            self._stage = "jacobian"


def _cost(residual: FloatArray) -> float:
    return float(residual @ residual)


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit ended.

    Attributes
    ----------
    candidate : Candidate
        The best values.
    residuals : ndarray of shape (m,) or None
        The residuals there; None if the start failed to simulate.
    jacobian : ndarray of shape (m, p) or None
        Their derivatives in the unit box (see `ParameterSpace.to_unit`), as far as they are known.
    simulations : int
        How many candidates were simulated.
    converged : bool
        Whether it ended because nothing was left to gain, rather than because the budget was spent.
    """

    candidate: Candidate
    residuals: FloatArray | None
    jacobian: FloatArray | None
    simulations: int
    converged: bool

    @property
    def cost(self) -> float:
        """Sum of squares; infinite if the start failed."""
        return float("inf") if self.residuals is None else _cost(self.residuals)


def minimise(
    function: Callable[[list[Candidate]], Sequence[FloatArray | None]],
    space: ParameterSpace,
    start: Candidate | None = None,
    budget: int = 100,
    settings: Settings | None = None,
) -> Fit:
    """Fit the parameters of a space by least squares.

    Parameters
    ----------
    function : callable
        ``function(candidates)`` returns the residuals of each, shape (m,), or None for one that failed;
        it may simulate them side by side.
    space : ParameterSpace
        What may move.
    start : Candidate, optional
        Where to begin; the space's initial values by default.
    budget : int, optional
        How many candidates may be simulated.
    settings : Settings, optional
        How to proceed.
    """
    search = LeastSquares(space.to_unit(space.project(start or space.initial)), settings=settings)
    while (left := budget - search.simulations) > 0:
        batch = search.ask(left)
        # What is left may not suffice for a first Jacobian.
        if not batch or len(batch) > left:
            break
        search.tell(list(function([space.from_unit(point) for point in batch])))
    return Fit(space.from_unit(search.point), search.residual, search.jacobian, search.simulations, search.converged)
