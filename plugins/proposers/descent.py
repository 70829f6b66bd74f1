"""A numerical fit over the trials of a run: find a feasible start, descend, and begin elsewhere if it is stuck."""

from collections.abc import Sequence
from typing import Literal, TypeGuard

import numpy as np
from pydantic import BaseModel, Field

from ...core.comparison.residuals import noise_of_residuals
from ...core.hooks import LowFidelityResiduals
from ...core.inference.fit_settings import Box, Settings
from ...core.inference.least_squares import LeastSquares
from ...core.inference.low_fidelity import LowFidelity
from ...core.parameters import Candidate
from ...core.rms import rms
from ...core.run.answer import CLEARLY_ABOVE
from ...core.task import Task
from ...core.trajectory import FloatArray
from ...core.trial import Trial, misfit_times_score
from .continuation import Reductions
from .feasibility import Feasibility

Status = Literal["infeasible", "descending", "restarting", "done"]

PERFECT = 0.02
"""Root mean square of the residuals, in tolerances, below which nothing is worth a simulation (20 µV)."""

_SAVED = 0.25
"""Factor on `PERFECT` for a fit that goes on from a point that somebody else found. Where below `PERFECT` a fit ends is
chance, and from a better point it must not end higher than without it."""

_SUSPICIOUS = 3.0
"""Root mean square above which a fit may have ended in a local minimum, rather than at the limit of the model or the
record: in tolerances, or in standard deviations of the noise if that is more."""

_UNRESOLVED = 0.1
"""Noise, in tolerances, that a fit need not come down to: no record resolves a tenth of a millivolt."""

_TOO_SLOW = 0.05
"""Share of the cost that a round must take off far from the record: at less, the budget ends before the fit does."""

_CRAWL = 0.5
"""Share of the cost, or of the squared score, that a round far from the record must gain: otherwise the fit is
in a local minimum."""

_FAR = 0.1
"""Share of the first misfit above which a fit is far from the record: nearer to it, a slow fit is not stuck."""

_ELSEWHERE = 0.2
"""How far from the first start the others lie, in units of the box."""

_ENDINGS = {
    "perfect": "no measurement is better than that",
    "noise": "a further step is predicted to gain less than the noise hides",
    "misfit": "a further step is predicted to gain less than this misfit leaves uncertain",
    "no progress": "no step gains what is predicted; differences are as small as the simulator's own error",
    "blocked": "no parameter could be varied there, for all simulations nearby failed",
}

_ROUNDING = 1e-9
"""Distance in units of the box below which two points are one."""

_STEPS_WORTH = 6
"""Simulations beyond a Jacobian without which a restart cannot get anywhere."""


class LedOptions(BaseModel, extra="forbid"):
    """Whether a fit is led by a low-fidelity model."""

    low_fidelity: bool = Field(
        True,
        description="Whether the simulator's low-fidelity model, if it has one, leads the way as long as that gains.",
    )


class DescentOptions(LedOptions):
    """How the numerical fit proceeds."""

    difference: float = Field(
        0.007, gt=0, le=0.2, description="Finite-difference step, as a share of each parameter's range."
    )
    radius: float = Field(0.3, gt=0, le=2, description="Longest step of a parameter, as a share of its range.")
    restarts: int = Field(2, ge=0, description="How often to begin elsewhere when the fit ends far from the record.")


class Descent:
    """Asks for candidates and is told their trials.

    It begins with the trial ``start``, which may have failed; ``seed`` is for what is random: where to look for a
    feasible start, where to begin again. ``low_fidelity`` is the model that leads the way (see
    `ProposeContext`).
    """

    def __init__(
        self,
        task: Task,
        options: DescentOptions,
        seed: int,
        start: Trial,
        low_fidelity: LowFidelityResiduals | None = None,
    ) -> None:
        self._low_fidelity = low_fidelity if options.low_fidelity else None
        self._task = task
        self._options = options
        self._seed = seed
        self._restarts_left = options.restarts
        self._restarting = False
        self._polled: list[FloatArray] = []
        self._promising: list[Trial] = []
        self._feasibility: Feasibility | None = None
        self._search: LeastSquares | None = None
        self._best: LeastSquares | None = None
        self._left_crawling: LeastSquares | None = None
        self._objective_before = float("inf")
        self._first_misfit = 0.0
        self.done = False
        """Whether the fit has nothing left to try."""
        self._limit = 0  # Simulations left at the last `ask`, less those made for it.
        self._early: list[Trial] = []  # First trials of a batch larger than what was left.
        self._told: list[Trial] = [start]
        self._noise_of_each = noise_of_residuals(task)
        self.noise = max(rms(self._noise_of_each), PERFECT)
        """What the records' noise leaves of a perfect fit, in tolerances."""
        self._suspicious = _SUSPICIOUS * max(1.0, self.noise)
        self._first_start: Candidate = task.space.initial
        if start.residuals is not None:
            self._begin_at(start)
        else:
            self._feasibility = Feasibility(task, start, seed)

    @property
    def status(self) -> Status:
        """Where the fit stands."""
        if self._search is None:
            return "infeasible"
        if self.done:
            return "done"
        return "restarting" if self._restarting else "descending"

    @property
    def best(self) -> LeastSquares | None:
        """The search that got lowest; None while nothing could be simulated."""
        searches = [search for search in (self._best, self._search) if search is not None]
        return min(searches, key=lambda search: search.cost, default=None)

    @property
    def base(self) -> Trial | None:
        """The trial of the best point; None while nothing could be simulated."""
        return None if self.best is None else self._trial_of(self.best)

    @property
    def cost(self) -> float:
        """Sum of squares of the best residuals."""
        return self.best.cost if self.best is not None else float("inf")

    @property
    def misfit(self) -> float:
        """Root mean square of the best residuals, in tolerances."""
        return rms(self.best.residual) if self.best is not None else float("inf")

    @property
    def ending(self) -> str:
        """Why the best fit has ended, in a sentence; empty while it goes on."""
        best = self.best
        if best is None or best.residual is None or not self.done:
            return ""
        above = best.ending == "noise" and self.misfit > CLEARLY_ABOVE * self.noise
        why = _ENDINGS.get(
            "misfit" if above else best.ending,
            f"a round gained less than {_TOO_SLOW:.0%}, or the simulations were spent",
        )
        stuck = [] if best.ending == "blocked" else [self._task.space.names[place] for place in best.failed]
        varied = (
            f" {', '.join(stuck)} could not be varied there: simulations with other values failed." if stuck else ""
        )
        return (
            f"The fit ends at {self.misfit:.2g} tolerances, where noise alone leaves {self.noise:.2g}: {why}.{varied}"
        )

    @property
    def reductions(self) -> Reductions:
        """How the task is reduced for each of the candidates just asked for; empty where it is not."""
        return self._feasibility.reductions if self._search is None and self._feasibility is not None else ()

    @property
    def way_back(self) -> str:
        """What is tried to find a cell that can be simulated, in a sentence; empty once there is one."""
        return self._feasibility.words if self._search is None and self._feasibility is not None else ""

    @property
    def next_stage(self) -> str:
        """What the candidates asked for are for, as `LeastSquares.stage` says; empty where nothing runs yet."""
        return "" if self._search is None else self._search.stage

    def ask(self, limit: int, planning_budget: int | None = None) -> list[Candidate]:
        """What to simulate next, at most ``limit`` candidates; empty when done.

        ``planning_budget`` is how many simulations to reckon with when the next Jacobian is weighed against more steps;
        ``limit`` by default. A fit that had ended goes on where more is left than was to be expected.
        """
        self.done = self.done and limit <= self._limit
        self._limit = limit
        points = self._points(limit, limit if planning_budget is None else min(planning_budget, limit))
        return [self._task.space.from_unit(point) for point in points]

    def _points(self, limit: int, planning_budget: int) -> list[FloatArray]:
        if limit <= 0 or self.done:
            return []
        if self._search is None:
            assert self._feasibility is not None
            return self._feasibility.ask()[:limit]
        self._search.plan()
        if self._is_stuck() and self._may_restart(limit):
            self._left_crawling = self._search
            return self._begin_again(planning_budget)
        points = [] if self._is_too_slow() else self._search.ask(planning_budget)
        if not points and self._may_restart(limit):
            points = self._begin_again(planning_budget)
        if not points and self._left_crawling is not None and self._left_crawling is self.best:
            # Nothing else was better: go on slowly there.
            self._search, self._left_crawling, self._early = self._left_crawling, None, []
            points = self._search.ask(planning_budget)
        self.done = not points
        return points[len(self._early) :][:limit]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Take in the trials of the candidates asked for, in order."""
        if not trials:
            return
        self._told += trials
        self._limit -= len(trials)
        if self._search is None:
            assert self._feasibility is not None
            found = self._feasibility.tell(trials)
            if found is not None:
                # Around the start as it was given, most is as infeasible as that.
                self._first_start = found.candidate
                self._begin_at(found)
            return
        if self._polled:
            self._take_starts(trials)
            return
        trials = [*self._early, *trials]
        self._early = []
        if len(trials) < len(self._search.ask()):
            self.done, self._early = True, trials
            return
        measured = self._search.stage == "jacobian"
        self._search.tell([trial.residuals for trial in trials])
        if measured and self._search.stage != "jacobian":
            self._objective_before = self._objective(self._search)
        if self._restarting and self._best is not None:
            self._restarting = self._search.cost > self._best.cost

    def adopt(self, trial: Trial, trials: Sequence[Trial]) -> None:
        """Go on from a better point that somebody else found.

        Of all ``trials`` so far those near it tell of the derivatives there.
        """
        self._best = self.best
        self._told.append(trial)
        self._feasibility = None
        self._begin_at(trial, self._jacobian_at(trial, trials), _SAVED * PERFECT)
        self.done = self._restarting = False
        self._polled, self._early = [], []

    def _jacobian_at(self, here: Trial, trials: Sequence[Trial]) -> FloatArray | None:
        """The fit's Jacobian made to agree with the trials that are no farther away than the fit, the nearest last."""
        best = self.best
        if best is None or best.jacobian is None or here.residuals is None:
            return None
        point, jacobian = self._task.space.to_unit(here.candidate), best.jacobian.copy()
        reach = (1.0 + _ROUNDING) * np.linalg.norm(best.point - point)
        whole = [(trial.candidate, trial.residuals) for trial in trials if trial.reduction is None]
        steps = [(self._task.space.to_unit(there) - point, seen) for there, seen in whole if seen is not None]
        for step, residuals in sorted(steps, key=lambda pair: -float(np.linalg.norm(pair[0]))):
            if _ROUNDING < np.linalg.norm(step) <= reach:
                jacobian += np.outer(residuals - here.residuals - jacobian @ step, step) / (step @ step)
        return jacobian

    def _begin_at(self, start: Trial, jacobian: FloatArray | None = None, enough: float = PERFECT) -> LeastSquares:
        """Descend from a trial, whose derivatives may be known, until the misfit is small ``enough``."""
        self._first_misfit = self._first_misfit or start.misfit
        freedom = max(len(self._noise_of_each) - len(self._task.space), 1)
        settings = Settings(
            difference=self._options.difference,
            radius=self._options.radius,
            noise=self.noise,
            # Above the noise the misfit is all that is known of the errors: one of its own squares is one deviation.
            tolerance=1.0 / freedom,
            enough=enough,
            emulates=True,
            elsewhere=_ELSEWHERE if start.misfit > self._suspicious else 0.0,
        )
        seen = [(trial.candidate, trial.residuals) for trial in self._told if trial.reduction is None]
        known = [(self._task.space.to_unit(there), found) for there, found in seen if found is not None]
        point = self._task.space.to_unit(start.candidate)
        low = None if self._low_fidelity is None else LowFidelity(self._low_residuals)
        self._search = LeastSquares(point, start.residuals, settings, jacobian=jacobian, known=known, low_fidelity=low)
        return self._search

    def _low_residuals(self, points: Sequence[FloatArray]) -> Sequence[FloatArray | None]:
        assert self._low_fidelity is not None
        return self._low_fidelity([self._task.space.from_unit(point) for point in points])

    def _is_too_slow(self) -> bool:
        """Whether a fit far from the record has come to a new Jacobian without having gained much by the last one."""
        search = self._search
        if not _comes_to_another_jacobian(search):
            return False
        return rms(search.residual) > self._suspicious and search.round_gain < _TOO_SLOW

    def _is_stuck(self) -> bool:
        search = self._search
        if not _comes_to_another_jacobian(search) or self._polled:
            return False
        # A step that has vanished can drown all else in the residuals: the score must have stalled too.
        gain = 1.0 - (self._objective(search) / self._objective_before) ** 2 if self._objective_before else 0.0
        far = rms(search.residual) > max(self._suspicious, _FAR * self._first_misfit)
        return far and max(search.round_gain, gain) < _CRAWL

    def _objective(self, search: LeastSquares) -> float:
        trial = self._trial_of(search)
        return float("inf") if trial is None else trial.objective

    def _trial_of(self, search: LeastSquares) -> Trial | None:
        """The trial of a search's best point."""
        return next((trial for trial in self._told if trial.residuals is search.residual), None)

    def _may_restart(self, limit: int) -> bool:
        polls = 0 if self._promising else 2 * len(self._task.space)
        needed = polls + len(self._task.space) + _STEPS_WORTH
        return self._restarts_left > 0 and self.misfit > _SUSPICIOUS * max(self.noise, _UNRESOLVED) and limit >= needed

    def _begin_again(self, planning_budget: int) -> list[FloatArray]:
        """Begin elsewhere: move each parameter alone far to either side of the first start, and go on from the best.

        The fit may have distributed over many parameters what one of them caused, and far from the record a slope may
        have the wrong sign: both sides are tried. Later restarts begin at the next best of these points.
        """
        self._best = self.best
        self._early = []
        self._restarting = True
        self._restarts_left -= 1
        if self._promising:
            return self._begin_at(self._promising.pop(0)).ask(planning_budget)
        origin = self._task.space.to_unit(self._first_start)
        points = Box.unit(len(origin)).beside(origin, _ELSEWHERE)
        self._polled = [point for point in points if not np.array_equal(point, origin)]
        return self._polled

    def _take_starts(self, trials: Sequence[Trial]) -> None:
        self._polled = []
        self._promising = sorted((trial for trial in trials if trial.residuals is not None), key=misfit_times_score)
        if self._promising:
            self._begin_at(self._promising.pop(0))


def _comes_to_another_jacobian(search: LeastSquares | None) -> TypeGuard[LeastSquares]:
    """Whether a fit that has taken steps on derivatives is about to simulate a Jacobian."""
    return search is not None and search.stage == "jacobian" and search.jacobian is not None
