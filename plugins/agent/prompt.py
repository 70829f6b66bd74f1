"""What the agent is told: Markdown sections with JSON blocks, then what it may answer."""

import json
from collections.abc import Mapping

from ...core.messages import Message
from ...core.prompt_sections import DIGEST, INSTRUCTION, section, title
from .actions import MOST_AT_ONCE, Kind, Offer
from .linear_advice import digest
from .method import system_message
from .situation import Situation

_WRITTEN = """\
Choose one action. Changes apply to the present values, inside the bounds. Write each as "*1.2" (multiply), "+0.02" or \
"-0.02" (add), or an absolute value such as "5.2e-6"; leave out what stays."""

_ACTIONS: dict[Kind, str] = {
    "set": 'simulate the changes in "updated_params".',
    "simulate": f'simulate up to {MOST_AT_ONCE} sets of changes, listed in "candidates".',
    "jacobian": 'measure effects here: each of "params" (default: all) moves alone by half a step, a simulation each.',
    "predict": 'free: what the measured effects promise of "updated_params", or else of the change they suggest.',
    "look": 'free: the measured and simulated curves of "step".',
    "refine": 'let the fit go on for "simulations" steps, moving only "params" if given.',
    "restart": 'go on from the earlier trial "trial".',
}

_COPY = """\
Answer with one JSON object. This one takes the suggested change; copy it, or change its numbers where you can give a \
reason. A "*" multiplies the present value by the number behind it."""

_LOOK_AT = """\
With any action you may list in "look_at" the cycles that the next feedback is to show in detail, such as \
[1, 40, 200]; of cycles without curves the nearest one that has them is shown."""

_MEASURE = "Answer with one JSON object. This one measures what each parameter does here, which comes first now."


def instruction(offer: Offer, gentler: str) -> str:
    """What may be asked for, a line an action, and how it is written."""
    told = {**_ACTIONS, "reduce": gentler}
    actions = "\n".join(f'- "{kind}": {told[kind]}' for kind in offer.kinds)
    more = f"\n{_LOOK_AT}" if offer.cycles else ""
    return f"{_WRITTEN} The actions:\n{actions}{more}"


def build_messages(situation: Situation, offer: Offer) -> list[Message]:
    """The conversation that asks for the next action."""
    sections = [*situation.sections(), title(INSTRUCTION) + instruction(offer, situation.task.domain.gentler)]
    system = system_message(situation.task, situation.base, offer.reasoning)
    return [system, Message("user", "\n\n".join(sections), situation.images)]


def build_digest(situation: Situation, offer: Offer, change: Mapping[str, str]) -> list[Message]:
    """The conversation for a small model: where the parameters stand, a digest, and a reply that can be copied.

    ``change`` is the suggested change; empty where effects are to be measured.
    """
    copied = {"action": "set", "updated_params": dict(change)} if change else {"action": "jacobian"}
    reasons = {"analysis": "...", "hypothesis": "...", "rationale": "..."} if offer.reasoning else {}
    sections = [
        situation.task_section(brief=True),
        section(DIGEST, {**situation.standing(), **digest(situation, change)}),
        f"{title(INSTRUCTION)}{_COPY if change else _MEASURE}\n{json.dumps(copied | reasons)}",
    ]
    system = system_message(situation.task, situation.base, offer.reasoning, brief=True)
    return [system, Message("user", "\n\n".join(sections), situation.images)]
