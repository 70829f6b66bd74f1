"""What the hybrid's agent is told: as the agent is, and what the numerical fit is doing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ....core.hooks import ProposeContext
from ....core.messages import Message
from ....core.prompt_sections import INSTRUCTION, NUMERICS, section, title
from ....core.trial import Trial
from ...agent.prompt import situation, system_message
from ...feedback.rounding import rounded

_INSTRUCTION = """\
A least-squares fit works beside you and does the arithmetic. You decide what to try. Give your analysis, one \
hypothesis about the physical cause, one action and your reasons. The actions:
- "refine": let the fit go on for "simulations" steps. With "refine_params" only those parameters move for a while.
- "set": try the values in "updated_params" ("*1.2", "+0.02", or an absolute value; applied to the present values).
- "jacobian": measure again what each parameter does at the present values.
- "restart": go on from the earlier trial with the number "trial".
- "reduce": {gentler}
"the_record" under Numerics says which parameters the record fixes, which it leaves open, and which move together: \
do not look for causes in open ones.
Let the fit go on while it gets on. Step in when it is stuck, when simulations fail or a step has vanished, or when \
you see a cause that it cannot see. What you try is kept only if it is better."""


def build_messages(
    context: ProposeContext, base: Trial, last: Trial | None, numerics: Mapping[str, Any], budget: int
) -> list[Message]:
    """The conversation that asks for the next action.

    Parameters
    ----------
    context : ProposeContext
        Where the run stands.
    base : Trial
        The candidate to which changes apply.
    last : Trial or None
        The agent's latest attempt, where it was no better.
    numerics : mapping
        What the fit is doing.
    budget : int
        Characters for each memory.
    """
    sections, images = situation(context, base, last, budget)
    instruction = _INSTRUCTION.replace("{gentler}", context.task.domain.gentler)
    sections.append(section(NUMERICS, rounded(dict(numerics))))
    sections.append(f"{title(INSTRUCTION)}{instruction} Simulations left: {context.simulations_left}.")
    return [system_message(context.task), Message("user", "\n\n".join(sections), images)]
