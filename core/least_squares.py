"""Bounded least squares for expensive, noisy simulations: Levenberg-Marquardt with Broyden's updates.

Derivatives are finite differences, asked for as one batch that can be simulated side by side. Between them the
Jacobian learns from each step by Broyden's rank-one update, which costs nothing. A candidate that fails to simulate
only makes the next step shorter; one that is rejected tells how the residuals bend, and the next step follows the bend.

References
----------
Levenberg, Quart. Appl. Math. 2 (1944) 164. Marquardt, SIAM J. Appl. Math. 11 (1963) 431. Broyden, Math.
Comp. 19 (1965) 577. Nocedal & Wright, Numerical Optimization, 2nd ed. (2006), Ch. 4, 10, 11 and Sec. 18.3.
Transtrum & Sethna, arXiv:1201.5885 (curvature along a step).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .bounded_step import bounded_step
from .differences import Column
from .errors import BsaError
from .trajectory import FloatArray

Stage = Literal["start", "jacobian", "other side", "step", "done"]

Ending = Literal["", "failed", "perfect", "noise", "misfit", "no progress"]
"""Why a fit has ended: its start failed; it is as good as perfect; the next step would gain less than the noise hides;
it would gain less than the misfit leaves uncertain; steps gain next to nothing although more is predicted."""

_GOOD, _POOR = 0.75, 0.25
"""Actual over predicted reduction: above the first the radius grows, below the second it shrinks."""

_AFTER_FAILURE = 0.35
"""Share of a failed step that is tried next."""

_SLOW = 0.1
"""A step that takes less than this share off the cost above the noise asks for a better Jacobian, if one can be had."""

_RESTORED = 0.25
"""Share of the first radius to which a new Jacobian opens the radius again."""

_IDLE_ROUNDS = 2
"""Jacobians in a row that may disappoint: the first one may have been taken where the cost bends most."""

_TRIFLE = 0.01
"""Share of a gain that is worth a simulation below which not even a short step is tried."""

_FORETOLD = 1e-6
"""Squared error of the model's last prediction, relative to the cost, below which the model is not in doubt."""

_EXACT = 1e-24
"""Cost relative to the first at which nothing is left to fit."""

_BEND = 0.75
"""Longest correction for curvature, as a share of the step that it corrects (Transtrum & Sethna 2012)."""

_ALONG = np.linspace(0.02, 1.0, 50)
"""Shares of a rejected step at which the curved model is looked at."""


@dataclass(frozen=True)
class Settings:
    """How a fit proceeds; lengths are in units of the coordinates.

    Attributes
    ----------
    difference : float
        Finite-difference step. Integrators leave noise: at a relative tolerance of 1e-5, steps well below
        0.005 of a parameter's range measure the noise instead.
    radius : float
        Longest first step.
    largest_radius, smallest_radius : float
        Limits of the trust radius; a fit whose steps would be shorter than the smallest has converged.
    noise : float
        Standard deviation of a residual. A gain in cost below its square says nothing about the parameters, and a fit
        goes on until no more is predicted.
    tolerance : float
        Share of the cost that must be gained to be worth a step, where that is more than the noise.
    enough : float
        Root mean square of the residuals at which the fit is as good as perfect.
    poor_steps : int
        Disappointing steps in a row before the Jacobian is taken anew.
    visible : float
        Root mean square change of the residuals over which a slope is taken, where an older Jacobian tells it; 0
        always takes ``difference``.
    ends_on_fresh : bool
        Whether the last Jacobian must have been taken at the best point, whatever the steps before it gained.
    """

    difference: float = 0.007
    radius: float = 0.3
    largest_radius: float = 1.0
    smallest_radius: float = 1e-4
    noise: float = 0.0
    tolerance: float = 1e-3
    enough: float = 0.0
    poor_steps: int = 2
    visible: float = 0.0
    ends_on_fresh: bool = False


@dataclass(frozen=True, eq=False)
class Box:
    """The coordinates of a fit, each array of shape (p,).

    Attributes
    ----------
    lower, upper : ndarray
        Bounds.
    prior : ndarray
        Cost of a unit of each coordinate: ``(prior x)^2`` is added to the sum of squares; 0 for no prior.
    difference : ndarray or None
        Finite-difference steps, where they are not all that of the settings.
    share : ndarray or None
        Finite-difference steps as shares of the coordinates' size, where these are longer.
    """

    lower: FloatArray
    upper: FloatArray
    prior: FloatArray
    difference: FloatArray | None = None
    share: FloatArray | None = None

    @classmethod
    def unit(cls, count: int) -> Box:
        """The unit box, without priors (see `ParameterSpace.to_unit`)."""
        return cls(np.zeros(count), np.ones(count), np.zeros(count))


class LeastSquares:
    """Minimises ``||r(x)||^2 + ||prior x||^2`` over a box by asking for residuals and being told them.

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
        What is known of the derivatives; taken anew when it disappoints.
    box : Box, optional
        Bounds and priors; the unit box without priors by default.

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
        box: Box | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self._box = box or Box.unit(len(start))
        self._point = np.clip(np.asarray(start, dtype=np.float64), self._box.lower, self._box.upper)
        self._free = np.ones(len(self._point), dtype=bool) if free is None else np.asarray(free, dtype=bool)
        self._radius = self.settings.radius
        self._residual = residual
        self._jacobian = None if jacobian is None else jacobian.copy()
        self._stale = jacobian is not None
        self._moved = jacobian is not None
        self._poor_steps = 0
        self._foretold = False
        self._idle_rounds = 0
        self._rejected: tuple[FloatArray, FloatArray] | None = None
        self._expected = 0.0
        self._batch: list[FloatArray] = []
        self._columns: list[Column] = []
        self.simulations = 0
        self.ending: Ending = ""
        self._stage: Stage = "start"
        if residual is not None:
            self._first_cost = self._round_cost = self.cost
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
        """What is known of the derivatives at the best point, shape (m, p); None before the first batch."""
        return self._jacobian

    @property
    def cost(self) -> float:
        """Sum of squares at the best point, the price of departing from the prior included; infinite if it failed."""
        return float("inf") if self._residual is None else self._cost_of(self._residual, self._point)

    @property
    def radius(self) -> float:
        """How far the linear model is trusted."""
        return self._radius

    @property
    def round_gain(self) -> float:
        """Share of the cost that the steps since the last Jacobian took off."""
        return 1.0 - self.cost / self._round_cost if self._residual is not None and self._round_cost > 0 else 0.0

    @property
    def predicted(self) -> float:
        """Fall in cost that a full step promises; infinite unless the Jacobian was taken at the best point."""
        if self._residual is None or self._jacobian is None or self._stale or self._moved:
            return float("inf")
        return self._predicted_gain(self._linear_step(np.inf))

    @property
    def stage(self) -> Stage:
        """What the next batch is for."""
        return self._stage

    @property
    def done(self) -> bool:
        """Whether nothing is left to ask."""
        return self._stage == "done"

    @property
    def converged(self) -> bool:
        """Whether it has ended because nothing was left to gain."""
        return self.ending not in ("", "failed")

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
            self._columns = self._wanted_columns()
            self._batch = self._differences()
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
            self._take_differences(usable)

    def _take_start(self, residual: FloatArray | None) -> None:
        self._residual = residual
        if residual is None:
            self._end("failed")
            return
        self._first_cost = self._round_cost = self.cost
        self._stage = "jacobian" if self._jacobian is None else "step"

    def renew_jacobian(self) -> None:
        """Ask for a new Jacobian next, whatever the one at hand still promises."""
        self._batch, self._stage = [], "jacobian"

    def _end(self, ending: Ending) -> None:
        self.ending = ending
        self._stage = "done"

    # --- derivatives ----------------------------------------------------------------------------------------

    def _wanted_columns(self) -> list[Column]:
        assert self._residual is not None
        count = len(self._point)
        lengths = np.full(count, self.settings.difference) if self._box.difference is None else self._box.difference
        if self._box.share is not None:
            lengths = np.maximum(lengths, self._box.share * np.abs(self._point))
        visible = self.settings.visible * float(np.sqrt(len(self._residual)))
        return [
            Column(
                int(place),
                float(self._point[place]),
                float(self._box.lower[place]),
                float(self._box.upper[place]),
                float(lengths[place]),
                0.0 if self._jacobian is None else float(np.linalg.norm(self._jacobian[:, place])),
                visible,
            )
            for place in np.flatnonzero(self._free)
        ]

    def _differences(self) -> list[FloatArray]:
        """The points of the columns that still want one."""
        points = []
        for column in self._columns:
            if column.wanted is not None:
                points.append(self._point.copy())
                points[-1][column.place] = column.wanted
        return points

    def _take_differences(self, residuals: list[FloatArray | None]) -> None:
        assert self._residual is not None
        if self._stage == "jacobian":
            # A column that cannot be measured stays zero: that parameter is left alone this time.
            self._jacobian = np.zeros((len(self._residual), len(self._point)))
        assert self._jacobian is not None
        asking = [column for column in self._columns if column.wanted is not None]
        for column, residual in zip(asking, residuals, strict=True):
            assert column.wanted is not None
            change = None if residual is None else residual - self._residual
            if change is not None:
                self._jacobian[:, column.place] = change / (column.wanted - self._point[column.place])
            column.take(None if change is None else float(np.linalg.norm(change)))
        self._batch = self._differences()
        if self._batch:
            self._stage = "other side"
            return
        self._stale, self._moved, self._foretold, self._poor_steps = False, False, False, 0
        self._round_cost = self.cost
        self._stage = "step"

    # --- steps ----------------------------------------------------------------------------------------------

    def _step(self) -> list[FloatArray]:
        step = self._curved_step()
        if step is None:
            step = self._linear_step(self._radius)
            self._expected = self._predicted_gain(step)
        if self._perfect():
            self._end("perfect")
            return []
        if self._expected <= self._worth and self._nothing_promised():
            return self._nothing_left()
        return [np.clip(self._point + step, self._box.lower, self._box.upper)]

    def _linear_step(self, radius: float) -> FloatArray:
        jacobian, residual = self._linear_model()
        return bounded_step(jacobian, residual, *self._room(), radius)

    def _room(self) -> tuple[FloatArray, FloatArray]:
        """How far each coordinate may move to either side."""
        return (
            np.where(self._free, self._box.lower - self._point, 0.0),
            np.where(self._free, self._box.upper - self._point, 0.0),
        )

    def _linear_model(self) -> tuple[FloatArray, FloatArray]:
        """Jacobian and residuals at the best point, the prior's rows included."""
        assert self._jacobian is not None
        assert self._residual is not None
        prior = self._box.prior
        return (
            np.vstack([self._jacobian, np.diag(prior)]),
            np.concatenate([self._residual, prior * self._point]),
        )

    def _predicted_gain(self, step: FloatArray) -> float:
        jacobian, residual = self._linear_model()
        return self.cost - _squares(residual + jacobian @ step)

    def _curved_step(self) -> FloatArray | None:
        """A step that follows the bend a rejected one has shown; None where there is none, or it promises nothing.

        Along the rejected step ``d`` the residuals are ``r + a J d + a^2 q``, ``q`` being what the linear model did not
        foresee. A correction ``a^2 c`` takes off what of ``q`` the parameters can take off: through a curved valley of
        the cost this leads much farther than a shorter straight step.
        """
        if self._rejected is None or self._stale:
            return None
        (place, seen), self._rejected = self._rejected, None
        jacobian, residual = self._linear_model()
        straight = place - self._point
        surprise = np.concatenate([seen, self._box.prior * place]) - residual - jacobian @ straight
        lower, upper = self._room()
        length = float(np.linalg.norm(straight))
        correction = bounded_step(jacobian, surprise, lower, upper, _BEND * length)
        linear, bent = jacobian @ straight, surprise + jacobian @ correction
        costs = [_squares(residual + share * linear + share**2 * bent) for share in _ALONG]
        best = int(np.argmin(costs))
        if self.cost - costs[best] <= self._worth:
            return None
        self._expected = self.cost - costs[best]
        return np.asarray(_ALONG[best] * straight + _ALONG[best] ** 2 * correction)

    @property
    def _worth(self) -> float:
        """Gain in cost that is worth a simulation."""
        return max(self.settings.noise**2, self.settings.tolerance * self.cost)

    def _nothing_promised(self) -> bool:
        """Whether nothing worth a simulation is predicted; short steps predict little merely by being short."""
        if self._expected <= _TRIFLE * self._worth:
            return True
        return self._predicted_gain(self._linear_step(self._restored)) <= self._worth

    @property
    def _restored(self) -> float:
        """The radius that a new Jacobian is trusted with."""
        return max(self._radius, _RESTORED * self.settings.radius)

    def _nothing_left(self) -> list[FloatArray]:
        """The model sees nothing to gain: look again if it may be wrong, else stop."""
        if self._moved and not self._round_is_the_last():
            self._stage = "jacobian"
            return self.ask()
        gain = self._predicted_gain(self._linear_step(self._restored))
        self._end("noise" if gain <= self.settings.noise**2 else "misfit" if gain <= self._worth else "no progress")
        return []

    def _perfect(self) -> bool:
        assert self._residual is not None
        return self.cost <= max(_EXACT * self._first_cost, len(self._residual) * self.settings.enough**2)

    def _round_is_the_last(self) -> bool:
        """Note a round, and say whether another is no use: the model was right, or the last rounds gained nothing."""
        if self.settings.ends_on_fresh:
            return False
        if self._foretold:
            return True
        if self._round_cost - self.cost < self._worth:
            self._idle_rounds += 1
        else:
            self._idle_rounds = 0
        return self._idle_rounds >= _IDLE_ROUNDS

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
            surprise = residual - (self._residual + self._jacobian @ step)
            gained = before - self._cost_of(residual, point)
            ratio = gained / max(self._expected, 1e-300)
            self._resize(ratio, length)
            slow = gained < _SLOW * (before - len(residual) * self.settings.noise**2)
            self._poor_steps = self._poor_steps + 1 if ratio < _POOR or slow else 0
            if gained <= 0:
                self._rejected = (point, residual)
            # Far away a rejected point says little of the slope here, if that was measured here.
            if gained > 0 or self._stale:
                self._jacobian += np.outer(surprise, step) / length**2
                self._stale = True
            if gained > 0:
                self._point, self._residual, self._moved, self._rejected = point, residual, True, None
                self._foretold = _squares(surprise) <= _FORETOLD * self.cost
        self._next_stage()

    def _resize(self, ratio: float, length: float) -> None:
        if ratio < _POOR:
            self._radius = _POOR * length if ratio < 0 else 0.5 * length
        elif ratio > _GOOD and length > 0.8 * self._radius:
            self._radius = min(2.0 * self._radius, self.settings.largest_radius)

    def _next_stage(self) -> None:
        short = self._radius < self.settings.smallest_radius
        if short and not self._moved:
            self._end("no progress")
        elif self._moved and (short or self._poor_steps >= self.settings.poor_steps):
            if self._round_is_the_last():
                self._end("no progress")
                return
            # It was the Jacobian that disappointed, perhaps not the length of the steps.
            self._radius = self._restored
            self._stage = "jacobian"

    def _cost_of(self, residual: FloatArray, point: FloatArray) -> float:
        return _squares(residual) + _squares(self._box.prior * point)


def _squares(values: FloatArray) -> float:
    return float(values @ values)


def solve(
    search: LeastSquares, residuals: Callable[[list[FloatArray]], Sequence[FloatArray | None]], budget: int
) -> None:
    """Ask and tell until nothing is left to gain or the budget is spent.

    Parameters
    ----------
    search : LeastSquares
        The fit.
    residuals : callable
        ``residuals(points)`` returns the residuals of each, shape (m,), or None for one that failed; it may simulate
        them side by side.
    budget : int
        How many points may be simulated.
    """
    while (left := budget - search.simulations) > 0:
        batch = search.ask(left)
        # What is left may not suffice for a first Jacobian.
        if not batch or len(batch) > left:
            return
        search.tell(list(residuals(batch)))
