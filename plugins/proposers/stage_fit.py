"""One stage of a calibration: a least-squares fit of its own parameters to its own part of the residuals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from ...core.hooks import LowFidelityResiduals
from ...core.inference.fit_settings import Box, Settings
from ...core.inference.identifiability import residual_noise
from ...core.inference.least_squares import LeastSquares
from ...core.inference.low_fidelity import LowFidelity
from ...core.parameters import Candidate
from ...core.rms import rms
from ...core.run.answer import FINEST_NOISE
from ...core.task import Task
from ...core.task_reduction import TaskReduction
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .feasibility import can_be_reduced
from .stage_data import Data, View

_USUAL_NOISE = 10.0
"""Standard deviation that is assumed at most, in tolerances: physical models of measured cells end at 5 to 15 mV. The
misfit of a start says how wrong the start is, and priors that are weighed against it would hold it there."""

SETTINGS = Settings(radius=2.0, noise=1.0, tolerance=5e-3, emulates=True)
"""Coordinates are in standard deviations of the priors, residuals in standard deviations of the misfit: beyond two of
the former a linear model is inaccurate, and a gain of one of the latter says nothing."""

_SHARE_OF_RANGE = 0.007
"""Finite difference of a parameter that has no deviation, as a share of its range."""

_TOLD = 0.25
"""Information of the data on a parameter, in that of its prior, below which the parameter stays where it is: the data
would narrow its prior by a tenth at most, for a simulation with every Jacobian. It is that of data fitted to the least
noise: what a misfit hides at first, the end of the fit may depend on."""

_DATA: dict[Data, str] = {
    "open-circuit": "rests and currents up to C/10",
    "current-steps": "the first minute after each current step, and spectra above 1 Hz",
    "rates": "currents above C/10",
    "temperature": "the measured temperature",
    "first-cycle": "the first cycle",
    "life": "the cycles after the first",
    "everything": "all of the records",
}


class StageChoice(BaseModel, extra="forbid"):
    """One stage."""

    name: str = Field(description="What the journal calls it.")
    data: Data = Field(description="The part of the records it is fitted to.")
    fits: list[str] = Field(
        default_factory=list, description="Its parameters: those whose names contain one of these; all if empty."
    )
    fits_after: dict[str, list[str]] = Field(
        default_factory=dict, description="Further parts of names, by the stage without which they are not fitted here."
    )
    after: str = Field("", description="A stage without which this one is skipped.")
    unless: str = Field("", description="A stage behind which this one is skipped.")
    again: str = Field(
        "",
        description="A stage that this one fits once more, from the same start with another noise; of the two ends the "
        "more probable one stands. Skipped where that one left less noise.",
    )
    adds: str = Field(
        "",
        description="An offered effect that it may add to the model, whose parameters no earlier stage fits; of its "
        "end and that of the stage before it the more probable one stands. Skipped where the effect is not offered.",
    )
    noise: float = Field(
        _USUAL_NOISE,
        gt=0,
        description="Standard deviation of residuals, in tolerances, that is assumed at most until the fit has ended.",
    )
    share: float = Field(1.0, gt=0, le=1, description="Share of the simulations still left that it may use.")
    scan: int = Field(
        0,
        ge=0,
        description="Values over the range of each of its parameters that has no prior, tried before the first "
        "derivatives: a rate that is off by orders of magnitude shows none.",
    )

    def takes(self, name: str, finished: Collection[str] = ()) -> bool:
        """Whether the stage fits a parameter, behind those that are finished."""
        parts = [*self.fits, *(part for stage in finished for part in self.fits_after.get(stage, ()))]
        return not self.fits or any(part.casefold() in name.casefold() for part in parts)


@dataclass(eq=False)
class Stage(ABC):
    """What is fitted to what, from where; asks for candidates and is told their trials."""

    task: Task
    choice: StageChoice
    view: View  # The part of the task's residuals that is fitted.
    chosen: NDArray[np.bool_]  # Its parameters, shape (p,).
    began: Trial  # Where it begins.
    left: int  # Simulations that it may use.
    # How the task is reduced for the candidates just asked for; None where it is not.
    reduction: TaskReduction | None = field(default=None, init=False)

    takes_slopes = False
    asked = False
    """Whether any of its candidates has been proposed."""
    wanting = 0
    """Simulations that the fit would have gone on with, had so many been left; 0 where it ended by itself."""

    def __post_init__(self) -> None:
        self._space = self.task.space
        self._free = self.chosen
        self._most = self.choice.noise
        self.here = self.began
        """The trial of its best point."""
        self.noise = self._misfit_noise()
        """Standard deviation of its residuals that is assumed, in tolerances."""

    @abstractmethod
    def ask(self, simulations_left: int) -> list[Candidate]:
        """What to simulate next; empty when the stage has ended."""

    @abstractmethod
    def tell(self, trials: Sequence[Trial]) -> Trial:
        """Take in the trials of the candidates asked for, in order; the trial of the best point."""

    def numbers(self) -> dict[str, float]:
        """What the fit knows of itself, for the journal."""
        seen = self._seen(self.here)
        assert seen is not None
        return {"misfit_tolerances": rms(seen), "noise_tolerances": self.noise}

    def describe(self) -> str:
        """What is fitted to what, in a sentence."""
        count = int(np.count_nonzero(self._free))
        how = f' (from where "{self.choice.again}" began)' * bool(self.choice.again)
        how += f' (with the effect "{self.choice.adds}")' * bool(self.choice.adds)
        return f'Stage "{self.choice.name}"{how}, {count} parameters on {_DATA[self.choice.data]}: {self._method}.'

    @property
    def _method(self) -> str:
        return "finite differences" if self.takes_slopes else "a least-squares step"

    def _misfit_noise(self) -> float:
        """The standard deviation that is likeliest given the misfit, its residuals taken as independent.

        Neighbours are alike while a fit has not come to its end, as they are where the model lacks something: widened
        by their correlation, the misfit of a fit on its way would end it there.
        """
        seen = self._seen(self.here)
        assert seen is not None
        return min(residual_noise(seen, int(np.count_nonzero(self._free)), FINEST_NOISE), self._most)

    def _weighed(self, trial: Trial) -> FloatArray | None:
        """The view's residuals in standard deviations."""
        seen = self._seen(trial)
        return None if seen is None else seen / self.noise

    def _seen(self, trial: Trial) -> FloatArray | None:
        """The view's residuals; None where the trial did not get so far."""
        of_all = trial.residuals if trial.reduction is None or trial.failed else trial.partial
        seen = None if of_all is None else self.view(of_all)
        return None if seen is None or np.any(np.isnan(seen)) else seen

    def _box(self) -> Box:
        steps = [p.difference if p.deviation is not None else _SHARE_OF_RANGE for p in self._space]
        return Box(self._space.lowest, self._space.highest, self._space.prior_weights, np.array(steps))

    def _point(self, trial: Trial) -> FloatArray:
        return np.array([p.coordinate(trial.candidate[p.name]) for p in self._space])


@dataclass(eq=False)
class StageFit(Stage):
    """A stage whose derivatives are simulated.

    One that is fitted to the first cycle simulates no other, and the whole task where it ended. What ``earlier`` trials
    show of its residuals is known to it. ``low_fidelity`` is a model that leads the way (see `ProposeContext`): the fit
    ends where that leads no further. In five fits of measured cells derivatives and an emulator gained another 0 to 5 %
    of the misfit, for 30 to 190 simulations.
    """

    earlier: Sequence[Trial] = ()
    low_fidelity: LowFidelityResiduals | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._told_so_far = list(self.earlier)
        self._first_cycle = _first_cycle_of(self.task) if self.choice.data == "first-cycle" else None
        self.reduction = self._first_cycle
        self._leads: LowFidelity | None = None
        if self.low_fidelity is not None:
            self._leads = LowFidelity(partial(self._low_residuals, self.low_fidelity), suffices=True)
        self._search = self._from_here()
        self._tried_first = self._spread(self.choice.scan)

    def _spread(self, count: int) -> list[Candidate]:
        """The values of a scan, one parameter moved at a time; none where fewer simulations are left."""
        found: list[Candidate] = []
        for place in np.flatnonzero(self.chosen & (self._space.prior_weights == 0.0)):
            parameter = self._space[self._space.names[place]]
            for position in (np.arange(count) + 0.5) / max(count, 1):
                found.append({**self.here.candidate, parameter.name: parameter.from_unit(float(position))})
        return found if len(found) < self.left else []

    def _begin_at_best(self, trials: Sequence[Trial]) -> Trial:
        """Begin at the best of the values tried, where one is better."""
        self._tried_first = []
        places = (self.here, *trials)
        costs = [
            np.inf if (residual := self._weighed(trial)) is None else float(residual @ residual) for trial in places
        ]
        self.here = places[int(np.argmin(costs))]
        self._search = self._from_here()
        return self.here

    def _from_here(self, jacobian: FloatArray | None = None, fresh: bool = False) -> LeastSquares:
        """A fit from the present point; with derivatives, of those parameters alone that the data tell something of.

        ``fresh`` is whether the derivatives were measured there.
        """
        # Where far residuals count little, a start tells little of what the data know.
        known = None if self.task.weight == "robust" else jacobian
        self._free = self.chosen if known is None else self.chosen & self._told(known)
        point, residual = self._point(self.here), self._weighed(self.here)
        seen = [(self._point(trial), self._weighed(trial)) for trial in self._told_so_far if trial is not self.here]
        earlier = [(there, found) for there, found in seen if found is not None]
        low = self._leads
        return LeastSquares(point, residual, SETTINGS, self._free, jacobian, self._box(), fresh, earlier, low)

    def _low_residuals(self, model: LowFidelityResiduals, points: Sequence[FloatArray]) -> list[FloatArray | None]:
        """The view's residuals by a low-fidelity model, in standard deviations."""
        found = model([self._space.at(point) for point in points])
        return [None if residual is None else self.view(residual) / self.noise for residual in found]

    def _told(self, jacobian: FloatArray) -> NDArray[np.bool_]:
        """Of which parameters the data can say something beside their priors; all of those without one."""
        information = np.sum((self.noise / FINEST_NOISE * jacobian) ** 2, axis=0)
        return np.asarray((information >= _TOLD) | (self._space.prior_weights == 0.0), dtype=np.bool_)

    @property
    def takes_slopes(self) -> bool:  # type: ignore[override]
        """Whether the candidates asked for are finite differences."""
        return self._search.stage == "jacobian"

    def ask(self, simulations_left: int) -> list[Candidate]:
        """What to simulate next; empty when the stage has ended."""
        if self._tried_first:
            return self._tried_first
        if self._first_cycle is not None and self.reduction is None:
            return []
        # The last one simulates all cycles where the fit of the first one ended.
        limit = min(self.left, simulations_left) - (self.reduction is not None)
        # What does not suffice for another Jacobian is left to later stages, if there are any.
        reckoned = limit if self.left >= simulations_left else None
        points = self._search.ask(reckoned) if limit > 0 else []
        if not points:
            self._most = max(self._most, _USUAL_NOISE)
        if (not points or self.takes_slopes) and self._noise_differs():
            before, self.noise = self.noise, self._misfit_noise()
            known, fresh = self._search.jacobian, bool(np.isfinite(self._search.predicted))
            if self._leads is not None:
                self._leads.weigh_anew(before / self.noise)
            self._search = self._from_here(None if known is None else before / self.noise * known, fresh)
            points = self._search.ask(reckoned) if limit > 0 else []
        if points and len(points) <= limit:
            return [self._space.at(point) for point in points]
        self.wanting = len(points)
        self.reduction = None
        return [self.here.candidate] if self.here.reduction is not None else []

    @property
    def _method(self) -> str:
        if self._first_cycle is not None and self.reduction is None:
            return "all cycles where it ended"
        if self._tried_first:
            return f"{len(self._tried_first)} values over the ranges of those without a prior"
        if self._search.stage == "low-fidelity":
            return "a step by the low-fidelity model"
        return "an emulator's step" if self._search.stage == "emulated" else super()._method

    def _noise_differs(self) -> bool:
        """Whether the misfit tells another noise than is assumed, by more than the standard error of its estimate."""
        seen = self._seen(self.here)
        assert seen is not None
        freedom = max(len(seen) - int(np.count_nonzero(self._free)), 1)
        return bool(abs(self._misfit_noise() / self.noise - 1.0) > (2.0 * freedom) ** -0.5)

    def tell(self, trials: Sequence[Trial]) -> Trial:
        """Take in the trials of the candidates asked for, in order; the trial of the best point."""
        self.left -= len(trials)
        self._told_so_far += trials
        if self._tried_first:
            return self._begin_at_best(trials)
        if self.here.reduction is not None and self.reduction is None:
            # A cell whose first cycle fits may fail in a later one.
            (whole,) = trials
            self.here = whole if whole.residuals is not None else self.began
            return self.here
        weighed = [self._weighed(trial) for trial in trials]
        first = self.takes_slopes and self._search.jacobian is None
        self._search.tell(weighed)
        for trial, residual in zip(trials, weighed, strict=True):
            if residual is not None and residual is self._search.residual:
                self.here = trial
        jacobian = self._search.jacobian
        if first and jacobian is not None and not self.takes_slopes:
            self._search = self._from_here(jacobian, fresh=True)
        return self.here


def _first_cycle_of(task: Task) -> TaskReduction | None:
    """The task up to the first cycle that its records show; None where that is all, or its cycles are not known."""
    if not can_be_reduced(task):
        return None
    first = max(experiment.target.steps[0].cycle for experiment in task.experiments)
    last = max(len(experiment.protocol or ()) for experiment in task.experiments)
    return TaskReduction(cycles=first) if first < last else None
