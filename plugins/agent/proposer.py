"""The agent proposer: one reply, one hypothesis, one candidate a round."""

from __future__ import annotations

from pydantic import BaseModel, Field

from ...core.errors import BsaError
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.messages import Backend
from ...core.parameters import Candidate, ParameterSpace
from ...core.proposal import Proposal
from ...core.trial import Trial
from .conversation import Answer, ask
from .prompt import build_messages
from .reply_schema import CheckedReply, check_reply, reply_schema
from .step_size import step_size


class AgentOptions(BaseModel, extra="forbid"):
    """How the agent is asked."""

    memory_budget: int = Field(9000, ge=500, description="Characters that each memory may take in the prompt.")
    adaptive_step: bool = Field(True, description="Whether changes shrink after an attempt that made it worse.")


class AgentProposer:
    """Asks the backend for a hypothesis and a change of the best candidate so far."""

    def __init__(self, options: AgentOptions, context: RunContext) -> None:
        self._options = options
        self._backend = require_backend(context)

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        base = context.best
        share = step_size(context.trials) if self._options.adaptive_step else 1.0
        last = context.trials[-1] if context.trials[-1].phase == "search" and context.trials[-1] is not base else None
        messages = build_messages(context, base, last, share, self._options.memory_budget)
        space = context.task.space
        answer = ask(
            self._backend,
            messages,
            reply_schema(space),
            lambda reply: check_reply(reply, space, base.candidate),
            context.seed,
        )
        return to_proposal(answer, space, base, share)


def require_backend(context: RunContext) -> Backend:
    """The run's backend.

    Raises
    ------
    BsaError
        If the run has none.
    """
    if context.backend is None:
        raise BsaError("this scaffold asks a language model, but the run has none.", "give --backend NAME.")
    return context.backend


def to_proposal(answer: Answer[CheckedReply], space: ParameterSpace, base: Trial, share: float) -> Proposal:
    """A checked reply as a proposal, or a lost round with the reasons."""
    details = {"step_size": share, "problems": list(answer.problems)}
    reply = answer.value
    if reply is None:
        return Proposal((), lost="; ".join(answer.problems) or "no usable reply", details=details)
    details["analysis"] = reply.analysis
    details["projected"] = list(reply.projected)
    return Proposal(
        (damped(space, base.candidate, reply.candidate, share),),
        hypothesis=reply.hypothesis,
        rationale=reply.rationale,
        updates=reply.updates,
        details=details,
    )


def damped(space: ParameterSpace, base: Candidate, wanted: Candidate, share: float) -> dict[str, float]:
    """The point a share of the way from the base to the wanted candidate, on each parameter's own scale."""
    if share >= 1.0:
        return space.project(wanted)
    start, end = space.to_unit(base), space.to_unit(wanted)
    return space.from_unit(start + share * (end - start))
