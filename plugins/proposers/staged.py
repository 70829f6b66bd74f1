"""Calibration in stages: each fits its own parameters to the part of the records that informs them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...core.errors import did_you_mean
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.offered_effects import absent_parameters
from ...core.parameters import Candidate
from ...core.proposal import LACKING, Proposal
from ...core.run.answer import answer
from ...core.task import Task
from ...core.trial import Trial
from .descent import Descent, DescentOptions, LedOptions
from .equilibrium_fit import EquilibriumFit
from .least_squares import next_proposal
from .stage_data import view_of
from .stage_fit import Stage, StageChoice, StageFit

_FEWEST_STEPS = 3
"""Steps after a Jacobian without which a stage is not worth its simulations."""


class StagedOptions(LedOptions):
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
        told = (name for stage in self.stages for name in (stage.after, stage.unless, stage.again))
        for name in (*self.order, *filter(None, told)):
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
        self._led = options.low_fidelity
        self._seed = context.seed
        self._descent: Descent | None = None
        self._here: Trial | None = None
        self._stage: Stage | None = None
        self._finished: dict[str, Stage] = {}
        self._skipped: dict[str, str] = {}
        self._before: int | None = None  # Simulations before the first stage.
        self._shares: list[float] = []  # Of the stages that were carried out or skipped for lack of simulations.
        self._lacking: list[str] = []
        self._lacked: list[StageChoice] = []  # Skipped stages that more simulations would have made possible.
        self._last: Stage | None = None
        self._allowed: int | None = None  # Simulations of the whole run, as far as was known at the last proposal.
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
        self._take_what_was_added(context)
        while True:
            if self._stage is None:
                self._stage = self._next_stage(context)
                if self._stage is None:
                    return self._last_proposal(context.simulations_left)
            candidates = self._stage.ask(context.simulations_left)
            if candidates:
                self._stage.asked = True
                return self._proposal(self._stage, candidates)
            self._end(self._stage, context)

    def _end(self, stage: Stage, context: ProposeContext) -> None:
        """Note that a stage has ended; of it and the one that it competes with the more probable end stands."""
        before, self._stage, self._last = self._last, None, stage
        self._finished[stage.choice.name] = stage
        if not stage.asked and not stage.wanting:
            self._skipped[stage.choice.name] = "no step promises a gain"
        other = before if stage.choice.adds else self._finished.get(stage.choice.again)
        if other is not None and answer(context.task, [other.here, stage.here]) is other.here:
            self._last, self._here = other, other.here

    @hookimpl
    def weighs_priors(self) -> bool:
        """See `RunHooks.weighs_priors`."""
        return True

    def _take_what_was_added(self, context: ProposeContext) -> None:
        """Spend what a run that was taken up again was given, where its stages had shared out all that it had.

        Stages that lacked simulations come first; where none did, the last stage goes on.
        """
        allowed = len(context.trials) + context.simulations_left
        more = allowed - (allowed if self._allowed is None else self._allowed)
        self._allowed = allowed
        if more <= 0 or self._plan:
            return
        if self._stage is None and self._lacked:
            self._plan, self._lacked = self._lacked, []
            self._lacking, self._shares, self._before = [], [], len(context.trials)
            return
        self._stage = self._stage or self._last
        if self._stage is not None:
            self._stage.left += more

    def _feasible_start(self, context: ProposeContext, news: Sequence[Trial]) -> Proposal | None:
        """What to simulate to find a start that can be; None once there is one."""
        if self._descent is None:
            self._descent = Descent(context.task, DescentOptions(), self._seed, context.best)
        else:
            self._descent.tell(news)
        if self._descent.status != "infeasible":
            self._here = self._descent.base
            return None
        return next_proposal(self._descent, context.simulations_left)

    def _next_stage(self, context: ProposeContext) -> Stage | None:
        """The next stage that has something to do; why others are skipped is noted."""
        if self._before is None:
            self._before = len(context.trials)
        while self._plan:
            choice = self._plan.pop(0)
            assert self._here is not None
            stage, why = self._prepared(choice, context)
            if stage is not None:
                self._shares.append(choice.share)
                return stage
            self._skipped[choice.name] = why
        return None

    def _prepared(self, choice: StageChoice, context: ProposeContext) -> tuple[Stage | None, str]:
        if choice.adds and choice.adds not in context.task.cell.offered:
            why = "in the model from the start" if choice.adds in context.task.cell.effects else "not offered"
            return None, f'the effect "{choice.adds}" is {why}'
        free = self._fitted_by(choice, context.task)
        budget = int(np.ceil(choice.share * context.simulations_left))
        if choice.after and choice.after not in self._finished:
            self._lacked += [choice] if choice.after in {lacked.name for lacked in self._lacked} else []
            return None, f'the stage "{choice.after}" was skipped'
        if choice.unless in self._finished:
            return None, f'the stage "{choice.unless}" was carried out'
        first = self._finished.get(choice.again)
        if choice.again and (first is None or first.noise <= choice.noise):
            return None, f'the stage "{choice.again}" was skipped, or left no more noise than this one assumes'
        if not np.any(free):
            return None, "none of its parameters is searched"
        view = view_of(context.task, choice.data)
        if view.lacking:
            return None, view.lacking
        start = self._start(context, choice) if first is None else first.began
        if choice.data == "open-circuit" and context.equilibrium([start.candidate]) is not None:
            return EquilibriumFit(context.task, choice, view, free, start, budget, context.equilibrium), ""
        # A first cycle alone is another task than what the low-fidelity model simulates.
        low = context.low_fidelity if self._led and choice.data != "first-cycle" else None
        if first is not None and low is None:
            return None, "another fit takes a low-fidelity model, which this task does not have"
        # Without such a model, derivatives are simulations of the search.
        needed = _FEWEST_STEPS + (int(np.count_nonzero(free)) if low is None else 0)
        if budget < needed:
            if first is not None:
                return None, f"the {context.simulations_left} simulations left do not suffice for another fit"
            return None, self._too_few(choice, int(np.count_nonzero(free)), needed, context)
        return StageFit(context.task, choice, view, free, start, budget, context.trials, low), ""

    def _fitted_by(self, choice: StageChoice, task: Task) -> NDArray[np.bool_]:
        """The parameters that a stage fits; not those of effects that are absent and that it does not add."""
        assert self._here is not None
        absent = set(absent_parameters(task, self._here.candidate)) - set(task.cell.offered.get(choice.adds, ()))
        return np.array([choice.takes(name, self._finished) and name not in absent for name in task.space.names])

    def _too_few(self, choice: StageChoice, parameters: int, needed: int, context: ProposeContext) -> str:
        """That the simulations left do not suffice for a stage, and of how many a run comes to it in any case."""
        self._shares.append(choice.share)
        self._lacked.append(choice)
        left = f"{context.simulations_left} simulations left"
        few = f"the {left} do" if choice.share == 1.0 else f"its share of {choice.share:g} of the {left} does"
        why = f"{few} not suffice for its {parameters} parameters, which take {needed}"
        enough = self._enough(len(context.trials) + context.simulations_left, needed)
        told = why if enough is None else f"{why}; at most {enough} simulations would have been needed"
        self._lacking.append(f'Stage "{choice.name}" is skipped: {told}.')
        return told

    def _enough(self, allowed: int, needed: int) -> int | None:
        """Of how many simulations a run comes to the last of the stages so far, though each before spends its share.

        None where one of them may spend all.
        """
        *before, last = self._shares
        if 1.0 in before:
            return None
        while True:
            allowed += 1
            left = allowed - (self._before or 0)
            for share in before:
                left -= int(np.ceil(share * left))
            if np.ceil(last * left) >= needed:
                return allowed

    def _start(self, context: ProposeContext, choice: StageChoice) -> Trial:
        """Where the stage before ended; for what is fitted to everything, the best trial if that is better."""
        assert self._here is not None
        best = context.best
        if choice.adds:
            return self._here
        if choice.data == "everything" and best.residuals is not None and best.objective < self._here.objective:
            return best
        return self._here

    def _proposal(self, stage: Stage, candidates: list[Candidate]) -> Proposal:
        skipped, self._skipped = self._skipped, {}
        notes = [f'Stage "{name}" is skipped: {why}.' for name, why in skipped.items()]
        return Proposal(
            tuple(candidates),
            rationale=" ".join([*notes, stage.describe()]),
            action="jacobian" if stage.takes_slopes else "refine",
            reductions=(stage.reduction,) * len(candidates),
            details={"stage": stage.choice.name, "skipped": skipped, **stage.numbers()},
            by_simulations=True,
        )

    def _last_proposal(self, simulations_left: int) -> Proposal:
        lacking = list(self._lacking)
        if self._last is not None and self._last.wanting > simulations_left:
            lacking.append(
                f'Stage "{self._last.choice.name}" ended before its next {self._last.wanting} simulations; '
                f"{simulations_left} are left."
            )
        notes = [f'Stage "{name}" is skipped: {why}.' for name, why in self._skipped.items()]
        return Proposal(
            (),
            rationale=" ".join([*notes, "All stages have ended."]),
            details={"skipped": self._skipped} | ({LACKING: " ".join(lacking)} if lacking else {}),
            finished=True,
            by_simulations=True,
        )
