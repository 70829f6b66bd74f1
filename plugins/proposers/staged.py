"""Calibration in stages: each fits its own parameters to the part of the records that informs them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from ...core.errors import did_you_mean
from ...core.fit_settings import Box, Settings
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.identifiability import effective_noise
from ...core.least_squares import LeastSquares
from ...core.parameters import Candidate, ParameterSpace
from ...core.proposal import Proposal
from ...core.task import Task
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .descent import Descent, DescentOptions
from .least_squares import words as search_words
from .stage_data import Data, View, view_of

_NOISE_FLOOR = 1.0
"""Standard deviation of a residual that is assumed at least, in tolerances: a good cycler's millivolt."""

_USUAL_NOISE = 10.0
"""Standard deviation that is assumed at most, in tolerances: physical models of measured cells end at 5 to 15 mV. The
misfit of a start says how wrong the start is, and priors that are weighed against it would hold it there."""

_SETTINGS = Settings(radius=2.0, noise=1.0, tolerance=5e-3)
"""Coordinates are in standard deviations of the priors, residuals in standard deviations of the misfit: beyond two of
the former a linear picture of a cell is a guess, and a gain of one of the latter says nothing."""

_SHARE_OF_RANGE = 0.007
"""Finite difference of a parameter that has no deviation, as a share of its range."""

_SETTLED = 0.7
"""Share of the assumed noise below which a fit has left it behind: the priors then weigh too much."""

_TOLD = 0.25
"""Information of the data on a parameter, in that of its prior, below which the parameter stays where it is: the data
would narrow its prior by a tenth at most, for a simulation with every Jacobian."""

_FEWEST_STEPS = 3
"""Steps after a Jacobian without which a stage is not worth its simulations."""


class StageChoice(BaseModel, extra="forbid"):
    """One stage."""

    name: str = Field(description="What the journal calls it.")
    data: Data = Field(description="The part of the records it is fitted to.")
    fits: list[str] = Field(
        default_factory=list, description="Its parameters: those whose names contain one of these; all if empty."
    )
    after: str = Field("", description="A stage without which this one is skipped.")
    share: float = Field(1.0, gt=0, le=1, description="Share of the simulations still left that it may use.")

    def takes(self, name: str) -> bool:
        """Whether the stage fits a parameter."""
        return not self.fits or any(part.casefold() in name.casefold() for part in self.fits)


class StagedOptions(BaseModel, extra="forbid"):
    """Which stages there are, and their order."""

    stages: list[StageChoice] = Field(
        default=[StageChoice(name="joint", data="everything")],
        min_length=1,
        description="The stages, in the order of the rules; one fit of everything if left out.",
    )
    order: list[str] = Field(
        default_factory=list,
        description="Names of the stages that run, in this order; one can be repeated or left out. All if empty.",
    )

    @model_validator(mode="after")
    def _known_names(self) -> StagedOptions:
        names = [stage.name for stage in self.stages]
        for name in (*self.order, *(stage.after for stage in self.stages if stage.after)):
            if name not in names:
                raise ValueError(f'there is no stage "{name}"; {did_you_mean(name, names) or f"stages: {names}"}')
        return self

    @property
    def plan(self) -> list[StageChoice]:
        """The stages that run."""
        by_name = {stage.name: stage for stage in self.stages}
        return [by_name[name] for name in self.order] if self.order else list(self.stages)


class StagedProposer:
    """Runs the stages one after the other; a Jacobian or a step a round.

    Each stage minimises its view of the residuals, over the standard deviation that the misfit itself shows, and the
    priors of its parameters. It begins where the stage before it ended. Rebuilt on resume by being asked the same
    questions.
    """

    def __init__(self, options: StagedOptions, context: RunContext) -> None:
        self._plan = options.plan
        self._seed = context.seed
        self._descent: Descent | None = None
        self._here: Trial | None = None
        self._stage: _StageFit | None = None
        self._finished: set[str] = set()
        self._skipped: dict[str, str] = {}
        self._seen = 0

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        news = context.trials[self._seen :]
        self._seen = len(context.trials)
        if self._here is None:
            start = self._feasible_start(context, news)
            if start is not None:
                return start
        elif self._stage is not None and news:
            self._here = self._stage.tell(news)
        while True:
            if self._stage is None:
                self._stage = self._next_stage(context)
                if self._stage is None:
                    return self._last_proposal()
            candidates = self._stage.ask(context.simulations_left)
            if candidates:
                return self._proposal(self._stage, candidates)
            self._finished.add(self._stage.choice.name)
            self._stage = None

    def _feasible_start(self, context: ProposeContext, news: Sequence[Trial]) -> Proposal | None:
        """What to simulate to find a start that can be; None once there is one."""
        if self._descent is None:
            self._descent = Descent(context.task, DescentOptions(), self._seed, context.best)
        else:
            self._descent.tell(news)
        if self._descent.status != "infeasible":
            self._here = self._descent.base
            return None
        candidates = tuple(self._descent.ask(context.simulations_left))
        return Proposal(
            candidates,
            rationale=search_words(self._descent),
            action="reduce",
            finished=not candidates,
            by_simulations=True,
            reductions=self._descent.reductions[: len(candidates)],
        )

    def _next_stage(self, context: ProposeContext) -> _StageFit | None:
        """The next stage that has something to do; why others are skipped is noted."""
        while self._plan:
            choice = self._plan.pop(0)
            assert self._here is not None
            stage, why = self._prepared(choice, context)
            if stage is not None:
                return stage
            self._skipped[choice.name] = why
        return None

    def _prepared(self, choice: StageChoice, context: ProposeContext) -> tuple[_StageFit | None, str]:
        free = np.array([choice.takes(name) for name in context.task.space.names])
        budget = int(np.ceil(choice.share * context.simulations_left))
        if choice.after and choice.after not in self._finished:
            return None, f'the stage "{choice.after}" was skipped'
        if not np.any(free):
            return None, "none of its parameters is searched"
        view = view_of(context.task, choice.data)
        if view.lacking:
            return None, view.lacking
        if budget < np.count_nonzero(free) + _FEWEST_STEPS:
            return None, f"{budget} simulations do not suffice for its {np.count_nonzero(free)} parameters"
        start = self._start(context, choice)
        return _StageFit(context.task, choice, view, free, start, budget), ""

    def _start(self, context: ProposeContext, choice: StageChoice) -> Trial:
        """Where the stage before ended; for what is fitted to everything, the best trial if that is better."""
        assert self._here is not None
        best = context.best
        if choice.data == "everything" and best.residuals is not None and best.objective < self._here.objective:
            return best
        return self._here

    def _proposal(self, stage: _StageFit, candidates: list[Candidate]) -> Proposal:
        skipped, self._skipped = self._skipped, {}
        notes = [f'Stage "{name}" is skipped: {why}.' for name, why in skipped.items()]
        return Proposal(
            tuple(candidates),
            rationale=" ".join([*notes, stage.describe()]),
            action="jacobian" if stage.takes_slopes else "refine",
            details={"stage": stage.choice.name, "skipped": skipped, **stage.numbers()},
            by_simulations=True,
        )

    def _last_proposal(self) -> Proposal:
        notes = [f'Stage "{name}" is skipped: {why}.' for name, why in self._skipped.items()]
        return Proposal((), rationale=" ".join([*notes, "All stages have ended."]), finished=True, by_simulations=True)


class _StageFit:
    """One stage: asks for candidates and is told their trials."""

    def __init__(
        self, task: Task, choice: StageChoice, view: View, free: NDArray[np.bool_], start: Trial, budget: int
    ) -> None:
        self.choice = choice
        self._space: ParameterSpace = task.space
        self._view = view
        self._chosen = self._free = free
        self._here = start
        self._left = budget
        self._noise = self._misfit_noise()
        self._search = self._from_here()

    def _from_here(self, jacobian: FloatArray | None = None, fresh: bool = False) -> LeastSquares:
        """A fit from the present point; with derivatives, of those parameters alone that the data tell something of.

        ``fresh`` is whether the derivatives were measured there.
        """
        self._free = self._chosen if jacobian is None else self._chosen & self._told(jacobian)
        point = np.array([p.coordinate(self._here.candidate[p.name]) for p in self._space])
        steps = [p.difference if p.deviation is not None else _SHARE_OF_RANGE for p in self._space]
        box = Box(self._space.lowest, self._space.highest, self._space.prior_weights, np.array(steps))
        return LeastSquares(point, self._weighed(self._here), _SETTINGS, self._free, jacobian, box, fresh)

    def _told(self, jacobian: FloatArray) -> NDArray[np.bool_]:
        """Of which parameters the data say something beside their priors; all of those without one."""
        information = np.sum(jacobian**2, axis=0)
        return np.asarray((information >= _TOLD) | (self._space.prior_weights == 0.0), dtype=np.bool_)

    def _weighed(self, trial: Trial) -> FloatArray | None:
        """The view's residuals in standard deviations."""
        return None if trial.residuals is None else self._view(trial.residuals) / self._noise

    @property
    def takes_slopes(self) -> bool:
        """Whether the candidates asked for are finite differences."""
        return self._search.stage == "jacobian"

    def ask(self, simulations_left: int) -> list[Candidate]:
        """What to simulate next; empty when the stage has ended."""
        limit = min(self._left, simulations_left)
        points = self._search.ask(limit) if limit > 0 else []
        if not points and self._improved():
            before, self._noise = self._noise, self._misfit_noise()
            known, fresh = self._search.jacobian, bool(np.isfinite(self._search.predicted))
            self._search = self._from_here(None if known is None else before / self._noise * known, fresh)
            points = self._search.ask(limit) if limit > 0 else []
        return [self._space.at(point) for point in points] if len(points) <= limit else []

    def _improved(self) -> bool:
        """Whether the misfit is now so much smaller than was assumed that the priors weigh too much."""
        return self._misfit_noise() < _SETTLED * self._noise

    def _misfit_noise(self) -> float:
        assert self._here.residuals is not None
        seen = self._view(self._here.residuals)
        return min(effective_noise(seen, int(np.count_nonzero(self._free)), _NOISE_FLOOR), _USUAL_NOISE)

    def tell(self, trials: Sequence[Trial]) -> Trial:
        """Take in the trials of the candidates asked for, in order; the trial of the best point."""
        weighed = [self._weighed(trial) for trial in trials]
        self._left -= len(trials)
        first = self._search.jacobian is None
        self._search.tell(weighed)
        for trial, residual in zip(trials, weighed, strict=True):
            if residual is not None and residual is self._search.residual:
                self._here = trial
        jacobian = self._search.jacobian
        if first and jacobian is not None and self._search.stage == "step":
            self._search = self._from_here(jacobian, fresh=True)
        return self._here

    def numbers(self) -> dict[str, float]:
        """What the fit knows of itself, for the journal."""
        assert self._here.residuals is not None
        seen = self._view(self._here.residuals)
        return {"misfit_tolerances": float(np.sqrt(np.mean(seen**2))), "noise_tolerances": self._noise}

    def describe(self) -> str:
        """What is fitted to what, in a sentence."""
        count = int(np.count_nonzero(self._free))
        what = "finite differences" if self.takes_slopes else "a least-squares step"
        return f'Stage "{self.choice.name}", {count} parameters on {_DATA[self.choice.data]}: {what}.'


_DATA: dict[Data, str] = {
    "open-circuit": "rests and currents up to C/10",
    "current-steps": "the first minute after each current step",
    "rates": "currents above C/10",
    "temperature": "the measured temperature",
    "first-cycle": "the first cycle",
    "life": "the cycles after the first",
    "everything": "all of the records",
}
