"""Perturbations that the model proposes (paper, Appendix: warm-up strategies)."""

from collections.abc import Mapping
from typing import Any

from ...core.errors import BsaError
from ...core.hooks import NoOptions, ProposeContext, RunContext, hookimpl
from ...core.messages import JsonSchema, Message
from ...core.parameters import Candidate, ParameterSpace
from ...core.printable import counted
from ...core.prompt_sections import INSTRUCTION, title
from ...core.proposal import PROBLEMS, Proposal
from ..agent.conversation import ask
from ..agent.method import system_message
from ..agent.proposer import require_backend
from ..agent.situation import Situation
from ..agent.updates import apply_updates, updates_schema
from .random import RandomWarmUp, RandomWarmUpOptions


class ProposedWarmUp:
    """Asks the model once for a list of perturbations; random ones fill in where it gives too few."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._backend = require_backend(context)
        self._random = RandomWarmUp(RandomWarmUpOptions(), context)

    @hookimpl
    def warm_up(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.warm_up`."""
        space, base, wanted = context.task.space, context.best, context.simulations_left
        situation = Situation.of(context)
        sections = situation.sections()
        sections.append(
            f"{title(INSTRUCTION)}Before the search, which has simulations of its own, we learn what each parameter "
            f"does. Propose {wanted} perturbations of the present values; each will be simulated. Choose them so that "
            "every parameter's effect can be told from the others. Where you expect the values elsewhere, make that "
            "move alone first and let all others share it, so that effects are measured there: effects come from "
            'the differences to the nearest simulation before. Write changes as "*1.1" or "+0.02".'
        )
        system = system_message(context.task, situation.base)
        messages = [system, Message("user", "\n\n".join(sections), situation.images)]
        answer = ask(
            self._backend,
            messages,
            _schema(space, wanted),
            lambda reply: _candidates(reply, space, base.candidate),
            context.seed,
        )
        candidates = (answer.value or ())[:wanted]
        missing = wanted - len(candidates)
        rationale = f"{counted(len(candidates), 'perturbation')} proposed by the model"
        if missing:
            fill = self._random.warm_up(context).candidates[:missing]
            candidates = (*candidates, *fill)
            rationale += f", {missing} drawn at random because it gave too few"
        return Proposal(
            candidates, rationale=rationale + ".", action="warm-up", details={PROBLEMS: list(answer.problems)}
        )


def _schema(space: ParameterSpace, wanted: int) -> JsonSchema:
    return {
        "type": "object",
        "properties": {
            "perturbations": {"type": "array", "items": updates_schema(space), "minItems": 1, "maxItems": wanted}
        },
        "required": ["perturbations"],
        "additionalProperties": False,
    }


def _candidates(reply: Mapping[str, Any], space: ParameterSpace, base: Candidate) -> tuple[Candidate, ...]:
    rows = reply.get("perturbations")
    if not isinstance(rows, list) or not rows:
        raise BsaError('the reply has no list "perturbations".', 'write {"perturbations": [{"<name>": "*1.1"}, ...]}.')
    candidates: list[Candidate] = []
    for row in rows:
        if not isinstance(row, Mapping):
            raise BsaError(f"a perturbation is {str(row)[:60]!r}, not an object.", "write {'<name>': '*1.1'}.")
        candidates.append(apply_updates(row, space, base)[0])
    return tuple(candidates)
