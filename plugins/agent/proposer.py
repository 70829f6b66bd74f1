"""The agent proposer: a round is one action, after as many free questions as it likes to ask, up to a few."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from ...core.errors import BsaError
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.messages import Backend, Message
from ...core.parameters import Candidate
from ...core.proposal import CHANGED_FROM, PROBLEMS, Proposal
from ...core.trial import closest
from .actions import FREE, Action, Kind, Offer, action_schema, check_action
from .conversation import Answer, answered, ask
from .free_actions import answer as free_answer
from .free_actions import picture, steps_to_look_at
from .linear_advice import as_factors, suggested
from .prompt import build_digest, build_messages
from .situation import Situation

_DIFFERENCE = 0.5
"""Typical steps by which a Jacobian moves a parameter: above the noise of the features, below their curvature."""

_STUCK = 3
"""Changes in a row that were no better, after which a digest asks for effects to be measured again."""

_IMPROVEMENT = 1e-3
"""Share of the misfit that a round must take off to count as progress."""


class AgentOptions(BaseModel, extra="forbid"):
    """How the agent is asked."""

    reasoning: bool = Field(True, description="Whether it is asked to think and to give reasons before it acts.")
    free_actions: int = Field(3, ge=0, description="Free questions (predict, look) in a round at most.")
    digest: bool = Field(
        False, description="Whether a digest (worst features, a suggested change to copy) is all that is told."
    )


class AgentProposer:
    """Asks the backend for a hypothesis and an action at the closest candidate so far."""

    def __init__(self, options: AgentOptions, context: RunContext) -> None:
        self._options = options
        self._backend = require_backend(context)
        self._clipped: tuple[str, ...] = ()
        self._look_at: tuple[int, ...] = ()
        self._measured = False
        self._failed: list[float] = []
        self._seen = 0

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        # Finite differences are no attempts.
        last = context.trials[-1] if context.trials[-1].phase == "search" and not self._measured else None
        self._note_attempts(context)
        situation = Situation.of(context, last, self._clipped, self._look_at, self._failed)
        offer, messages = self._digest(situation) if self._options.digest else self._whole(situation)
        answer, free = converse(self._backend, situation, offer, messages, self._options.free_actions)
        action = answer.value
        self._clipped = action.projected if action is not None else ()
        self._look_at = action.look_at if action is not None else self._look_at
        self._measured = action is not None and action.kind == "jacobian"
        return _proposal(answer, free, situation)

    def _note_attempts(self, context: ProposeContext) -> None:
        """Keep the lengths of the changes from the present trial that were no better."""
        before, new = context.trials[: self._seen], context.trials[self._seen :]
        self._seen = len(context.trials)
        base = closest(context.trials)
        if not before or closest(before) is not base or self._measured:
            self._failed = []
        else:
            space = context.task.space
            steps = (space.steps_between(base.candidate, trial.candidate) for trial in new)
            self._failed += [float(np.linalg.norm(change)) for change in steps]

    def _digest(self, situation: Situation) -> tuple[Offer, list[Message]]:
        """A suggested change to copy; or to measure where none is known, or several from here were no better."""
        left, space = situation.context.simulations_left, situation.task.space
        stuck = len(self._failed) >= _STUCK and left > len(space) + _STUCK
        change = {} if stuck else as_factors(suggested(situation), situation.base.candidate)
        kind: Kind = "set" if change or not situation.remembers or left < 2 else "jacobian"
        if kind == "set" and not change:
            first = next(iter(space))
            change = {first.name: first.typical_step}
        offer = Offer((kind,), space, reasoning=self._options.reasoning)
        return offer, build_digest(situation, offer, change)

    def _whole(self, situation: Situation) -> tuple[Offer, list[Message]]:
        kinds: list[Kind] = ["set"]
        if situation.context.simulations_left > 1:
            # What nothing remembers need not be measured.
            kinds += ["simulate", "jacobian"] if situation.remembers else ["simulate"]
        offer = offer_of(situation, kinds, self._options.free_actions, self._options.reasoning)
        return offer, build_messages(situation, offer)


def offer_of(situation: Situation, kinds: Sequence[Kind], most_free: int, reasoning: bool = True) -> Offer:
    """These actions, and the free ones that have something to show."""
    task, steps = situation.task, steps_to_look_at(situation)
    shown = {"predict": bool(situation.sensitivities.effects), "look": bool(steps)}
    free = [kind for kind in FREE if most_free and shown[kind]]
    return Offer((*kinds, *free), task.space, steps, reasoning, bool(task.domain.drives), situation.cycles)


def converse(
    backend: Backend, situation: Situation, offer: Offer, messages: list[Message], most_free: int
) -> tuple[Answer[Action], list[str]]:
    """Ask until there is an action that is not free; gives what came of it, and the free actions on the way."""
    context, base = situation.context, situation.base.candidate
    free: list[str] = []
    while True:
        last = len(free) >= most_free
        kinds = tuple(kind for kind in offer.kinds if kind not in FREE) if last else offer.kinds
        now = replace(offer, kinds=kinds)
        answer = ask(
            backend,
            messages,
            action_schema(now),
            lambda reply, now=now: check_action(reply, now, base, context.trials),  # type: ignore[misc]
            context.seed + 1000 * len(free),
        )
        action = answer.value
        if action is None or action.kind not in FREE or answer.reply is None:
            return answer, free
        free.append(action.kind)
        more = "" if len(free) < most_free else " No more free actions in this round: simulate something."
        told = free_answer(action, situation) + f"\n\nNow choose again.{more}"
        messages = answered(messages, answer.reply.text, told, picture(action, situation))


def require_backend(context: RunContext) -> Backend:
    """The run's backend. Raises `BsaError` if the run has none."""
    if context.backend is None:
        raise BsaError("this scaffold asks a language model, but the run has none.", "give --backend NAME.")
    return context.backend


def differences(situation: Situation, parameters: tuple[str, ...], limit: int) -> list[Candidate]:
    """The present candidate with one parameter moved at a time, to the side with more room, as many as fit."""
    base = situation.base.candidate
    chosen = [one for one in situation.task.space if not parameters or one.name in parameters]
    moved = {one.name: one.a_step_aside(base[one.name], _DIFFERENCE) for one in chosen}
    found: list[Candidate] = [{**base, name: value} for name, value in moved.items() if value != base[name]]
    return found[:limit]


def _proposal(answer: Answer[Action], free: list[str], situation: Situation) -> Proposal:
    """A checked reply as a proposal, or a lost round with the reasons."""
    details: dict[str, Any] = {PROBLEMS: list(answer.problems)}
    if free:
        details["free_actions"] = free
    action = answer.value
    if action is None:
        return Proposal((), lost=answer.complaint or "no usable reply", details=details)
    details |= {
        CHANGED_FROM: situation.base.index,
        "analysis": action.analysis,
        "projected": list(action.projected),
    }
    if action.kind == "jacobian":
        candidates = differences(situation, action.parameters, situation.context.simulations_left)
        details["authors"] = ["jacobian"] * len(candidates)
    else:
        candidates = list(action.candidates)
    return Proposal(
        tuple(candidates),
        hypothesis=action.hypothesis,
        rationale=action.rationale,
        action=action.kind,
        updates=action.updates or {},
        details=details,
        lost="" if candidates else "no parameter can be moved from here",
        advancing=action.kind == "jacobian" or _got_on(situation),
    )


def _got_on(situation: Situation) -> bool:
    """Whether the latest round brought the search closer by its own measure."""
    trials = situation.context.trials
    before = [trial for trial in trials if (trial.phase, trial.round) != (trials[-1].phase, trials[-1].round)]
    return bool(before) and situation.base.misfit < (1.0 - _IMPROVEMENT) * closest(before).misfit
