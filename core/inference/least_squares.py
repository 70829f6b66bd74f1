"""Bounded least squares for expensive, noisy simulations: Levenberg-Marquardt with Broyden's updates, or an emulator.

Derivatives are finite differences, asked for as one batch that can be simulated side by side. After each step the
Jacobian gets Broyden's rank-one update, which takes no simulation. If a step fails and the Jacobian was measured at the
best point, the step was too long, and the next one is shorter. If the Jacobian was updated, it may be wrong, and a new
one is measured.

Where simulations cost much more than linear algebra (`Settings.emulates`), steps between two Jacobians lead to where
an emulator of all simulations expects the least cost (`EmulatedSteps`). With twenty parameters a Jacobian costs as much
as twenty such steps. After the first Jacobian, Broyden's updates are used until they fail: an emulator of so few
simulations is hardly better.

Where there is a low-fidelity model (`LowFidelity`), the first steps lead to where that one, corrected, expects the
least cost. They need no Jacobian of the full model; the first one is measured where such steps gain little.

References
----------
Levenberg, Quart. Appl. Math. 2 (1944) 164. Marquardt, SIAM J. Appl. Math. 11 (1963) 431. Broyden, Math.
Comp. 19 (1965) 577. Nocedal & Wright, Numerical Optimization, 2nd ed. (2006), Ch. 4, 10, 11 and Sec. 18.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..bounded_step import damped_step
from ..errors import BsaError
from ..trajectory import FloatArray
from .differences import Differences
from .emulated_steps import EmulatedSteps
from .fit_settings import Box, Settings
from .guided_steps import POOR, GuidedSteps
from .led_steps import LedSteps
from .low_fidelity import LowFidelity

Stage = Literal["start", "low-fidelity", "jacobian", "step", "emulated", "done"]

Ending = Literal["", "failed", "perfect", "noise", "misfit", "no progress", "blocked"]
"""Why a fit has ended: its start failed; it is as good as perfect; the next step would gain less than the noise hides;
it would gain less than the misfit leaves uncertain; steps gain next to nothing although more is predicted; no neighbour
of the best point could be simulated, so that nothing is known of what is left to gain."""

_GOOD = 0.6
"""Actual over predicted reduction above which the damping falls; below `POOR` it grows."""

_LESS, _MORE, _MUCH_MORE = 0.2, 4.0, 8.0
"""Factors of the damping: after a good step, after a poor one, and after a failed one until the next is short."""

_RAISES = 12
"""Times that the damping is raised after a failure, at most: from the least to where steps are next to nothing."""

_POOR_STEPS = 2
"""Poor steps in a row before a new Jacobian."""

_KNOWS_MORE = 2.0
"""Simulations, in units of those that determine a linear model, from which an emulator is asked in place of Broyden's
updates. Of fewer it learns the slopes but hardly how they change, and its steps are short. A measured record of 25
parameters ends at 18 mV in 40 simulations, with 1.5 too, and at 42 with 1; the worst of twelve published tasks ends at
0.08 % in 100 simulations, and at 0.30 % with 1."""

_LEAST = 1e-7
"""Least damping."""

_IDLE_ROUNDS = 2
"""Jacobians in a row that may lead to no gain: the first one may have been taken where the cost is most curved."""

_FORETOLD = 1e-6
"""Squared error of the model's prediction, relative to the cost, below which the Jacobian is still that of the best
point."""

_EXACT = 1e-24
"""Cost relative to the first at which nothing is left to fit."""


class LeastSquares:
    """Minimises ``||r(x)||^2 + ||prior x||^2`` over a box by asking for residuals and being told them.

    Parameters
    ----------
    start : ndarray of shape (p,)
        Where to begin.
    residual : ndarray of shape (m,), optional
        The residuals there, if they are known already.
    free : ndarray of bool, shape (p,), optional
        Which coordinates may move; all by default.
    jacobian : ndarray of shape (m, p), optional
        What is known of the derivatives; computed again when steps by it fail.
    box : Box, optional
        Bounds and priors; the unit box without priors by default.
    fresh : bool
        Whether the derivatives were measured at the start itself.
    known : sequence of (point, residual)
        Earlier simulations, of which an emulator learns too.
    low_fidelity : LowFidelity, optional
        A cheaper model that leads the way.

    Attributes
    ----------
    point, residual : ndarray of shapes (p,) and (m,)
        The best point found, and the residuals there; None if the start failed.
    jacobian : ndarray of shape (m, p) or None
        What is known of the derivatives at the best point; None before the first batch.
    damping : float
        Damping of the steps; large where the linear model has predicted badly.
    stage : {'start', 'low-fidelity', 'jacobian', 'step', 'emulated', 'done'}
        What the next batch is for.
    failed : tuple of int
        Coordinates of which no neighbour could be simulated for the last Jacobian; a fit leaves them where they are.

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
        fresh: bool = False,
        known: Sequence[tuple[FloatArray, FloatArray]] = (),
        low_fidelity: LowFidelity | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self._box = box or Box.unit(len(start))
        self.point = np.clip(np.asarray(start, dtype=np.float64), self._box.lower, self._box.upper)
        self._free = np.ones(len(self.point), dtype=bool) if free is None else np.asarray(free, dtype=bool)
        self.damping = self._known_damping = self.settings.damping
        self.residual = residual
        self.jacobian = None if jacobian is None else jacobian.copy()
        self._fresh = fresh
        self._blocked = False
        self.failed: tuple[int, ...] = ()
        self._poor_steps = 0
        # Before the first Jacobian a low-fidelity model that gains nothing says nothing of Jacobians.
        self._idle_rounds = 0 if low_fidelity is None else -1
        self._closer = False
        self._batch: list[FloatArray] = []
        self._differences: Differences | None = None
        self._round_cost = self._first_cost = np.inf
        self.simulations = 0
        self.ending: Ending = ""
        self.stage: Stage = "start"
        self._led: LedSteps | None = None
        if low_fidelity is not None:
            self._led = LedSteps(low_fidelity, _fitted, self.settings, self._free, self._box)
        self._emulated: EmulatedSteps | None = None
        if self.settings.emulates and np.any(self._free):
            self._emulated = EmulatedSteps(self._box, self._free, self.settings.noise, self.settings.radius)
            for place, seen in [*known, *([] if residual is None else [(self.point, residual)])]:
                self._emulated.remember(place, seen)
        if residual is None:
            self._batch = [self.point]
        else:
            self._begin()
            self._plan()

    @property
    def cost(self) -> float:
        """Sum of squares at the best point, the price of departing from the prior included; infinite if it failed."""
        return np.inf if self.residual is None else self._box.cost(self.point, self.residual)

    @property
    def round_gain(self) -> float:
        """Share of the cost that the steps since the last Jacobian took off."""
        return 1.0 - self.cost / self._round_cost if self.residual is not None and self._round_cost > 0 else 0.0

    @property
    def predicted(self) -> float:
        """Predicted gain in cost of a full step; infinite unless the Jacobian was measured at the best point."""
        return self._full_gain if self._fresh and not self._blocked else np.inf

    @property
    def done(self) -> bool:
        """Whether nothing is left to ask."""
        return self.stage == "done"

    def ask(self, limit: int | None = None) -> list[FloatArray]:
        """The points whose residuals are wanted next, each of shape (p,) inside the box; empty when done.

        ``limit`` is how many can still be simulated. Where they do not suffice for a new Jacobian, the one at
        hand, or the emulator, is used to the end; where these predict no gain, it is asked for all the same.
        """
        self.plan()
        if self.stage == "jacobian" and not self._batch:
            if self.jacobian is not None and limit is not None and limit <= np.count_nonzero(self._free):
                self._plan_last_step()
            if not self._batch:
                assert self.residual is not None
                self._differences = Differences(
                    self.point, self.residual, self.jacobian, self._box, self.settings, self._free, self._closer
                )
                self._batch = self._differences.points
                if not self._batch:
                    self._take_jacobian(self._differences)
                    self._end(self._why_nothing_is_left())
        return [point.copy() for point in self._batch]

    def tell(self, residuals: Sequence[FloatArray | None]) -> None:
        """Take in the residuals of the batch, in order; None for a point that failed to simulate.

        Raises `BsaError` if their number is not that of the points asked for.
        """
        if len(residuals) != len(self._batch):
            raise BsaError(f"{len(self._batch)} points were asked for, but {len(residuals)} residuals were told.")
        self.simulations += len(residuals)
        usable = [value if value is not None and np.all(np.isfinite(value)) else None for value in residuals]
        batch, self._batch = self._batch, []
        if self._emulated is not None:
            for point, residual in zip(batch, usable, strict=True):
                self._emulated.remember(point, residual)
        if self.stage == "start":
            self.residual = usable[0]
            self._begin()
        elif self.stage == "step":
            self._take_step(batch[0], usable[0])
        elif self.stage == "emulated":
            self._take_guided_step(self._emulated, batch[0], usable[0])
        elif self.stage == "low-fidelity":
            self._take_guided_step(self._led, batch[0], usable[0])
        else:
            self._take_differences(usable)
        self._plan()

    def _begin(self) -> None:
        self._first_cost = self._round_cost = self.cost
        if self.residual is None:
            self._end("failed")
        elif self._led is not None:
            self.stage = "low-fidelity"
        else:
            self.stage = "jacobian" if self.jacobian is None else "step"

    def renew_jacobian(self) -> None:
        """Ask for a new Jacobian next, whatever gain the present one predicts."""
        self._batch, self.stage = [], "jacobian"

    def _end(self, ending: Ending) -> None:
        self.ending = ending
        self.stage = "done"

    # --- derivatives ----------------------------------------------------------------------------------------

    def _take_differences(self, residuals: list[FloatArray | None]) -> None:
        assert self._differences is not None
        self._differences.take(residuals)
        self._batch = self._differences.points
        if not self._batch:
            self._take_jacobian(self._differences)
            self._poor_steps = 0
            # The step may have failed for its Jacobian, not its length.
            self.damping = self._known_damping
            too_short = self._predicted_gain(self._linear_step(self.damping)) <= self._worth
            if too_short and self._idle_rounds < _IDLE_ROUNDS:
                self.damping = self.settings.damping
            self._round_cost = self.cost
            self.stage = "step"

    def _take_jacobian(self, measured: Differences) -> None:
        self.jacobian, self._fresh = measured.jacobian, True
        self.failed, self._blocked = measured.failed, measured.blocked

    # --- steps ----------------------------------------------------------------------------------------------

    def _plan(self) -> None:
        """Decide what comes next, so that it is known before it is asked for whether that is a new Jacobian."""
        if self.stage in ("low-fidelity", "step", "emulated") and self._perfect():
            self._end("perfect")
        if self.stage == "step":
            self._plan_step()
        if self.stage == "emulated":
            self._plan_emulated_step()

    def plan(self) -> None:
        """Settle what comes next where the low-fidelity model has to be simulated for that; nothing elsewhere."""
        if self.stage == "low-fidelity" and not self._batch:
            self._plan_low_fidelity_step()

    def _plan_low_fidelity_step(self) -> None:
        """The next point by the low-fidelity model; without it where it promises little, or has failed too often."""
        assert self._led is not None
        if self._plan_guided_step(self._led):
            return
        if self._led.suffices:
            self._end(self._ending_at(self._led.promised))
        else:
            self._next_round()

    def _plan_guided_step(self, guide: GuidedSteps) -> bool:
        """Ask for the next point by a model of the residuals; whether there is one."""
        assert self.residual is not None
        there = guide.next(self.point, self.residual, self.cost, self._worth)
        self._batch = [] if there is None else [there]
        return there is not None

    def _plan_step(self) -> None:
        step = self._linear_step(self.damping)
        if self._predicted_gain(step) > self._worth:
            self._batch = [self._moved(step)]
        else:
            self._leave_linear_steps()

    def _leave_linear_steps(self) -> None:
        """Go on where the linear model gains no more: by an emulator, if it has seen enough simulations."""
        if self._emulator_knows(1.0):
            self.stage = "emulated"
        else:
            self._next_round()

    def _plan_emulated_step(self) -> None:
        """The next point by the emulator; another Jacobian where it predicts little, or has failed too often."""
        assert self._emulated is not None
        if not self._plan_guided_step(self._emulated):
            self._emulated.begin_anew()
            self._next_round()

    def _plan_last_step(self) -> None:
        """The next point where too few simulations are left for another Jacobian; none if no gain is predicted."""
        assert self.residual is not None
        if self._emulated is not None and self._emulator_knows(1.0):
            stage: Stage = "emulated"
            there = self._emulated.at_once(self.point, self.residual, self.cost, self._worth)
        else:
            stage, step = "step", self._linear_step(self.damping)
            there = self._moved(step) if self._predicted_gain(step) > self._worth else None
        if there is not None:
            self.stage, self._batch = stage, [there]

    def _next_round(self) -> None:
        """Go on with another Jacobian, or end."""
        if self._another_round():
            self.stage = "jacobian"
        else:
            self._end("no progress" if self._poor_steps >= _POOR_STEPS else self._why_nothing_is_left())

    def _moved(self, step: FloatArray) -> FloatArray:
        return np.clip(self.point + step, self._box.lower, self._box.upper)

    def _take_guided_step(self, guide: GuidedSteps | None, point: FloatArray, residual: FloatArray | None) -> None:
        assert guide is not None
        gained = self._gained(point, residual)
        guide.judge(self.point, point, residual, gained, self.cost, self._worth)
        if residual is not None and gained > 0:
            # The derivatives were not measured there.
            self.point, self.residual, self.jacobian, self._fresh = point, residual, guide.derivatives(point), False
            self.damping = self._known_damping = self.settings.damping

    def _gained(self, point: FloatArray, residual: FloatArray | None) -> float:
        """By how much the cost falls at a point; minus infinity where it failed."""
        return -np.inf if residual is None else self.cost - self._box.cost(point, residual)

    def _linear_step(self, damping: float) -> FloatArray:
        jacobian, residual = self._linear_model()
        reach = np.where(self._free, self.settings.radius, 0.0)
        lower = np.maximum(self._box.lower - self.point, -reach)
        upper = np.minimum(self._box.upper - self.point, reach)
        return damped_step(jacobian, residual, lower, upper, damping)

    def _linear_model(self) -> tuple[FloatArray, FloatArray]:
        """Jacobian and residuals at the best point, the prior's rows included."""
        assert self.jacobian is not None
        assert self.residual is not None
        prior = self._box.prior
        return (np.vstack([self.jacobian, np.diag(prior)]), np.concatenate([self.residual, prior * self.point]))

    def _predicted_gain(self, step: FloatArray) -> float:
        jacobian, residual = self._linear_model()
        # Not less than `cost`, which is summed in another order: the rounding error would be a predicted gain for ever.
        return _squares(residual) - _squares(residual + jacobian @ step)

    @property
    def _full_gain(self) -> float:
        """Predicted gain in cost of a full step: that of a short one is small because it is short."""
        return self._predicted_gain(self._linear_step(_LEAST))

    @property
    def _worth(self) -> float:
        """Gain in cost that is worth a simulation."""
        return max(self.settings.noise**2, self.settings.tolerance * self.cost)

    def _why_nothing_is_left(self) -> Ending:
        if self._fresh and self._blocked:
            return "blocked"
        return self._ending_at(self._full_gain)

    def _ending_at(self, gain: float) -> Ending:
        """Why a fit ends where it predicts a gain."""
        return "noise" if gain <= self.settings.noise**2 else "misfit" if gain <= self._worth else "no progress"

    def _perfect(self) -> bool:
        assert self.residual is not None
        return self.cost <= max(_EXACT * self._first_cost, len(self.residual) * self.settings.enough**2)

    def _another_round(self) -> bool:
        """Whether a new Jacobian may show more than the one at hand."""
        if self._fresh:
            looks_closer = self.settings.closer > 0 and not self._closer and self._full_gain > self._worth
            self._closer = self._closer or looks_closer
            return looks_closer
        idle = self._round_cost - self.cost <= self._worth
        self._idle_rounds = self._idle_rounds + 1 if idle else 0
        return self.settings.ends_on_fresh or self._idle_rounds < _IDLE_ROUNDS

    def _take_step(self, point: FloatArray, residual: FloatArray | None) -> None:
        assert self.residual is not None
        assert self.jacobian is not None
        step, gained = point - self.point, self._gained(point, residual)
        ratio = gained / max(self._predicted_gain(step), 1e-300)
        fresh, failed = self._fresh, gained <= 0
        if failed:
            self.damping = self._shortening(step)
        if residual is not None and not (failed and fresh):
            # Far away a rejected point says little of the slope here, if that was measured here.
            surprise = residual - self.residual - self.jacobian @ step
            self.jacobian += np.outer(surprise, step) / _squares(step)
            self._fresh = fresh and _squares(surprise) <= _FORETOLD * self.cost
        if not failed:
            assert residual is not None
            self.point, self.residual = point, residual
            self.damping = max(self.damping * (_LESS if ratio > _GOOD else _MORE if ratio < POOR else 1.0), _LEAST)
        if fresh or not failed:
            self._known_damping = self.damping
        # On a fresh Jacobian a failed step was too long; else it may be the Jacobian that is wrong.
        self._poor_steps = self._poor_steps + 1 if ratio < POOR and not (failed and fresh) else 0
        # Of an updated Jacobian an emulator knows more, once its simulations have shown how the slopes change.
        if self._poor_steps >= _POOR_STEPS or (not self._fresh and self._emulator_knows(_KNOWS_MORE)):
            self._leave_linear_steps()

    def _emulator_knows(self, times: float) -> bool:
        """Whether an emulator knows so many times the simulations that determine a linear model."""
        linear = int(np.count_nonzero(self._free)) + 1
        return self._emulated is not None and self._emulated.known >= times * linear

    def _shortening(self, failed: FloatArray) -> float:
        """The damping by which the next step is at most half as long as one that failed."""
        norms = np.linalg.norm(self._linear_model()[0], axis=0)
        damping = self.damping
        for _ in range(_RAISES):
            damping *= _MUCH_MORE
            if np.linalg.norm(norms * self._linear_step(damping)) <= 0.5 * np.linalg.norm(norms * failed):
                break
        return damping


def _squares(values: FloatArray) -> float:
    return float(values @ values)


def solve(
    search: LeastSquares, residuals: Callable[[list[FloatArray]], Sequence[FloatArray | None]], budget: int
) -> None:
    """Ask and tell until nothing is left to gain, or as many points as the budget allows are simulated.

    ``residuals(points)`` returns the residuals of each, shape (m,), or None for one that failed; it may simulate them
    side by side.
    """
    while (left := budget - search.simulations) > 0:
        batch = search.ask(left)
        # What is left may not suffice for a first Jacobian.
        if not batch or len(batch) > left:
            return
        search.tell(list(residuals(batch)))


def _fitted(
    model: LowFidelity,
    point: FloatArray,
    residual: FloatArray,
    settings: Settings,
    free: NDArray[np.bool_],
    box: Box,
    budget: int,
) -> tuple[FloatArray, float]:
    """A fit of a corrected low-fidelity model: the best point and its cost; see `LedSteps`."""
    fit = LeastSquares(point, residual, settings, free, model.jacobian, box, known=model.known)
    solve(fit, model.corrected, budget)
    model.jacobian = fit.jacobian
    return fit.point, fit.cost
