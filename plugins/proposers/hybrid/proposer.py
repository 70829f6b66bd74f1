"""The hybrid: a least-squares fit, and an agent that proposes candidates beside it.

The main fit is that of the least-squares proposer. Until it ends, at least four fifths of the simulations are its own;
those of the agent are counted apart. The fit goes on from a candidate of the agent only if the cost there is clearly
lower, and that simulation then counts as a step of the fit. An agent that finds nothing better leaves the fit as it
would be with a fifth fewer simulations; one that does saves it the steps to that point.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ....core.hooks import ProposeContext, RunContext, hookimpl
from ....core.inference.identifiability import effective_noise, identify
from ....core.inference.residual_errors import NOISE_FLOOR
from ....core.parameters import Candidate
from ....core.prompt_sections import RECORD
from ....core.proposal import ALREADY_SIMULATED, CHANGED_FROM, FIT, PROBLEMS, Proposal
from ....core.trial import Trial, simulated_with
from ...agent.actions import Action, Kind
from ...agent.conversation import Answer
from ...agent.proposer import converse, offer_of, require_backend
from ...agent.situation import Situation
from ..continuation import LOWERED, Continuation, CurrentRateContinuation, FirstCycleContinuation, Reductions
from ..descent import Descent, DescentOptions
from ..feasibility import gentle_direction, progress
from ..least_squares import action as main_action
from ..least_squares import numbers, words
from ..trial_errors import sum_of_squares
from .agent_search import AgentSearch
from .prompt import build_messages

_NUDGE = 0.1
"""How far "reduce" moves towards a gentler cell, in units of the box."""

_WORTH_ASKING = 1.0
"""Misfit in tolerances below which a finished fit is good enough to end without another word."""

_BETTER = 0.9
"""The agent's best point must have less than this share of the main fit's cost for the fit to go over to it."""

_SHOWN_ACTIONS, _SHOWN_ROUNDS = 5, 6

_REACHED = "misfit_reached_tolerances"


class HybridOptions(DescentOptions):
    """How the agent and the numerical fit share a run."""

    agent_share: float = Field(0.2, ge=0, le=0.5, description="Share of the simulations that the agent may direct.")
    free_actions: int = Field(3, ge=0, description="Free questions (predict, look) in a round at most.")


class HybridProposer:
    """Asks the agent for an action while the fit descends; both are simulated side by side."""

    def __init__(self, options: HybridOptions, context: RunContext) -> None:
        self._options = options
        self._space = context.task.space
        self._seed = context.seed
        self._backend = require_backend(context)
        self._main: Descent | None = None
        self._agent_search: AgentSearch | Continuation | None = None
        self._agent_best: Trial | None = None
        self._last_attempt: Trial | None = None
        self._log: list[dict[str, Any]] = []
        self._misfits: list[float] = []
        self._clipped: tuple[str, ...] = ()
        self._look_at: tuple[int, ...] = ()
        self._seen = self._present = 0
        self._main_asked = 0
        self._main_spent, self._agent_spent, self._hold = 0, 0, 0

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        main_fit = self._take(context)
        main = main_fit.ask(context.simulations_left, self._planning_budget(context))
        reductions = _padded(main_fit.reductions, len(main))
        left = context.simulations_left - len(main)
        allowance = self._allowance(left, bool(main))
        answer: Answer[Action] | None = None
        own: list[Candidate] = []
        if self._agent_search is None and allowance > 0 and self._should_ask(main_fit, bool(main)):
            answer = self._ask(context, main_fit, allowance)
            if answer.value is not None:
                own = self._begin(answer.value, context, main_fit, allowance)
        if self._agent_search is not None:
            own = self._agent_search.ask(allowance)
            if not own:
                self._agent_search = None
        reductions += _padded(getattr(self._agent_search, "reductions", ()), len(own))
        self._main_asked = len(main)
        self._seen = len(context.trials)
        return self._proposal(main_fit, main, own, answer, allowance, reductions)

    def _take(self, context: ProposeContext) -> Descent:
        """Hand the new trials to those who asked for them."""
        if self._main is None:
            self._main = Descent(context.task, self._options, self._seed, context.best, context.low_fidelity)
            self._main_spent = len(context.trials)
            return self._main
        new = context.trials[self._seen :]
        ours, theirs = new[: self._main_asked], new[self._main_asked :]
        self._main.tell(ours)
        self._main_spent += len(ours)
        self._hold -= len(ours)
        self._take_own(theirs)
        if self._agent_best is not None and sum_of_squares(self._agent_best) < _BETTER * self._main.cost:
            self._main.adopt(self._agent_best, context.trials)
            # It stands for a step of the fit, so that an agent that leads can go on.
            self._main_spent += 1
            self._agent_spent -= 1
        self._misfits.append(self._main.misfit)
        return self._main

    def _take_own(self, trials: Sequence[Trial]) -> None:
        self._agent_spent += len(trials)
        if self._agent_search is not None:
            self._agent_search.tell(trials)
            if self._agent_search.over:
                self._agent_search = None
        # A reduced simulation is no attempt at the task.
        trials = [trial for trial in trials if trial.reduction is None]
        if not trials:
            return
        found = min(trials, key=sum_of_squares)
        if self._agent_best is None or sum_of_squares(found) < sum_of_squares(self._agent_best):
            self._agent_best = found
        self._last_attempt = found
        latest = self._log[-1]
        if found.misfit < float("inf"):
            latest[_REACHED] = min(found.misfit, latest.get(_REACHED, float("inf")))
        elif _REACHED not in latest:
            latest["failed"] = True

    def _planning_budget(self, context: ProposeContext) -> int | None:
        """What would be left to a fit on its own with the share of the simulations that is the fit's here.

        Near its end such a fit saves a last Jacobian for more steps; so must this one, to be no worse.
        """
        total = len(context.trials) + context.simulations_left
        alone = int((1.0 - self._options.agent_share) * total) - self._main_spent
        return alone if alone > 0 else None

    def _allowance(self, left: int, main_goes_on: bool) -> int:
        """How many simulations the agent may direct now."""
        if not main_goes_on:
            return left
        share = self._options.agent_share
        return min(int(share / (1.0 - share) * self._main_spent) - self._agent_spent, left)

    def _should_ask(self, main_fit: Descent, main_goes_on: bool) -> bool:
        return self._hold <= 0 if main_goes_on else main_fit.misfit > _WORTH_ASKING

    def _ask(self, context: ProposeContext, main_fit: Descent, allowance: int) -> Answer[Action]:
        situation = Situation.of(context, self._last_attempt, self._clipped, self._look_at)
        kinds: list[Kind] = ["refine", "set", "jacobian", "restart", "reduce"]
        if allowance > 1:
            kinds.insert(2, "simulate")
        offer = offer_of(situation, kinds, self._options.free_actions)
        self._present = situation.base.index
        messages = build_messages(situation, offer, self._numerics(main_fit, allowance))
        answer, _ = converse(self._backend, situation, offer, messages, self._options.free_actions)
        action = answer.value
        self._clipped = action.projected if action is not None else ()
        self._look_at = action.look_at if action is not None else self._look_at
        return answer

    def _numerics(self, main_fit: Descent, allowance: int) -> dict[str, Any]:
        content: dict[str, Any] = {
            "status": main_fit.status,
            "misfit_tolerances_by_round": self._misfits[-_SHOWN_ROUNDS:],
            "simulations_you_may_spend": allowance,
            "your_last_actions": self._log[-_SHOWN_ACTIONS:],
        }
        best = main_fit.best
        if best is not None and best.jacobian is not None and best.residual is not None:
            here = self._space.from_unit(best.point)
            noise = effective_noise(best.residual, len(self._space), NOISE_FLOOR)
            found = identify(best.jacobian, best.residual, self._space, here, noise)
            content[RECORD] = {
                "leaves_open": list(found.open),
                "narrows": list(found.loose),
                "only_together": [list(group) for group in found.correlated],
            }
        return content

    def _begin(self, action: Action, context: ProposeContext, main_fit: Descent, allowance: int) -> list[Candidate]:
        """Start what the agent asked for: candidates to try at once, or a search of its own."""
        self._log.append({"action": action.kind, "hypothesis": action.hypothesis[:120]})
        free = np.array([not action.parameters or name in action.parameters for name in self._space.names])
        count = min(action.simulations, allowance)
        if action.carries_on:
            self._hold = action.simulations
        elif action.kind in ("set", "simulate"):
            new = [candidate for candidate in action.candidates if not simulated_with(candidate, context.trials)]
            if len(new) < len(action.candidates):
                self._log[-1][ALREADY_SIMULATED] = len(action.candidates) - len(new)
            return new[:allowance]
        elif action.kind == "reduce" and context.task.domain.drives and (action.rate or action.cycles):
            self._agent_search = self._continuation(action, context, count)
        elif action.kind == "reduce":
            start = self._space.to_unit(context.best.candidate) + _NUDGE * gentle_direction(context.task)
            jacobian = None if allowance > len(self._space) + 1 else _jacobian(main_fit)
            self._agent_search = AgentSearch(self._space, start, count, jacobian=jacobian, robust=True)
        elif action.kind == "restart":
            trial = context.trials[action.trial or 0]
            self._agent_search = self._search_from(trial, main_fit, count, allowance, free)
        elif main_fit.base is not None and action.kind == "refine":
            base = main_fit.base
            start = self._space.to_unit(base.candidate)
            self._agent_search = AgentSearch(self._space, start, count, base.residuals, _jacobian(main_fit), free)
        elif main_fit.base is not None:
            count = max(count, int(np.count_nonzero(free)) + 3)
            self._agent_search = self._search_from(main_fit.base, main_fit, count, allowance, free)
        return []

    def _continuation(self, action: Action, context: ProposeContext, count: int) -> Continuation:
        """Over an easier task, from the best trial or, if none ran, from the one that got farthest."""
        whole = [trial for trial in context.trials if trial.reduction is None]
        start = context.best if context.best.ok else max(whole, key=lambda trial: progress(context.task, trial))
        point = self._space.to_unit(start.candidate)
        if action.cycles is not None:
            return FirstCycleContinuation(self._space, point, action.cycles, count)
        assert action.rate is not None
        # Lower rates to fall back on, should the cell not run at this one either.
        rates = (action.rate, *(lower for lower in LOWERED if lower < action.rate))
        return CurrentRateContinuation(self._space, point, gentle_direction(context.task), rates)

    def _search_from(
        self, start: Trial, main_fit: Descent, count: int, allowance: int, free: NDArray[np.bool_]
    ) -> AgentSearch:
        """From a trial, with derivatives of its own where the allowance covers them; ``free`` is what may move."""
        differences = int(np.count_nonzero(free))
        fresh = allowance > differences + 1
        count = max(count, differences + 2) if fresh else count
        jacobian = None if fresh else _jacobian(main_fit)
        point = self._space.to_unit(start.candidate)
        return AgentSearch(self._space, point, min(count, allowance), start.residuals, jacobian, free)

    def _proposal(
        self,
        main_fit: Descent,
        main: list[Candidate],
        own: list[Candidate],
        answer: Answer[Action] | None,
        allowance: int,
        reductions: Reductions,
    ) -> Proposal:
        action = answer.value if answer is not None else None
        details: dict[str, Any] = {
            **numbers(main_fit),
            "main_simulations": len(main),
            "agent_simulations": len(own),
            "agent_allowance": max(allowance, 0),
            "authors": [FIT] * len(main) + ["agent"] * len(own),
        }
        if answer is not None:
            details[PROBLEMS] = list(answer.problems)
        if action is not None:
            details["analysis"] = action.analysis
            if action.candidates and not main:
                details[CHANGED_FROM] = self._present
            if ALREADY_SIMULATED in self._log[-1]:
                details[ALREADY_SIMULATED] = self._log[-1][ALREADY_SIMULATED]
        return Proposal(
            (*main, *own),
            hypothesis=action.hypothesis if action is not None else "",
            rationale=action.rationale if action is not None else words(main_fit),
            action=action.kind if action is not None else main_action(main_fit),
            updates=(action.updates or {}) if action is not None else {},
            details=details,
            lost=answer.complaint if answer is not None and action is None and not main else "",
            finished=not main and not own,
            advancing=bool(main),
            reductions=reductions if any(reductions) else (),
        )


def _jacobian(main_fit: Descent) -> Any:
    return main_fit.best.jacobian if main_fit.best is not None else None


def _padded(reductions: Reductions, count: int) -> Reductions:
    return (*reductions[:count], *[None] * (count - len(reductions)))
