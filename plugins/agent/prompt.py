"""What the agent is told: Markdown sections with JSON blocks, then what it may answer."""

from __future__ import annotations

from ...core.messages import Message
from ...core.prompt_sections import DIGEST, INSTRUCTION, section, title
from .actions import MOST_AT_ONCE, Kind, Offer
from .ageing_method import LOOK_AT
from .linear_advice import digest
from .method import system_message
from .situation import Situation

_WRITTEN = """\
Choose one action. Changes apply to the present values, inside the bounds. Write each as "*1.2" (multiply), "+0.02" or \
"-0.02" (add), or an absolute value such as "5.2e-6"; leave out what stays as it is."""

_ACTIONS: dict[Kind, str] = {
    "set": 'simulate the changes in "updated_params".',
    "simulate": f'simulate up to {MOST_AT_ONCE} sets of changes, listed in "candidates".',
    "jacobian": 'measure effects here: each of "params" (default: all) moves alone by half a step, a simulation each.',
    "predict": 'free: what the measured effects promise of "updated_params", or else of the change they suggest.',
    "look": 'free: the measured and simulated curves of "step".',
    "refine": 'let the fit go on for "simulations" steps, moving only "params" if given.',
    "restart": 'go on from the earlier trial "trial".',
}

_ADVICE = "Take the suggested change, or a better one that you can give a reason for."


def actions_told(offer: Offer, gentler: str = "") -> str:
    """The list of the actions, a line each."""
    told = {**_ACTIONS, "reduce": gentler}
    return "\n".join(f'- "{kind}": {told[kind]}' for kind in offer.kinds)


def instruction(offer: Offer, gentler: str = "") -> str:
    """What may be asked for, and how it is written."""
    more = f"\n{LOOK_AT}" if offer.cycles else ""
    return f"{_WRITTEN} The actions:\n{actions_told(offer, gentler)}{more}"


def build_messages(situation: Situation, offer: Offer, short: bool = False) -> list[Message]:
    """The conversation that asks for the next action.

    Parameters
    ----------
    short : bool
        Whether a digest stands in for the memories.
    """
    sections = situation.sections(memories=not short)
    advice = []
    if short:
        sections.append(section(DIGEST, digest(situation)))
        advice = [_ADVICE]
    sections.append(title(INSTRUCTION) + "\n".join([instruction(offer), *advice]))
    system = system_message(situation.task, situation.base, offer.analysis_chars > 0)
    return [system, Message("user", "\n\n".join(sections), situation.images)]
