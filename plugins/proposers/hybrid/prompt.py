"""What the hybrid's agent is told: as the agent is, and what the numerical fit is doing."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ....core.messages import Message
from ....core.prompt_sections import (
    ALIKE,
    INSTRUCTION,
    NUMERICS,
    PRIORS,
    RECORD,
    SENSITIVITIES,
    numbered,
    section,
    title,
)
from ...agent.actions import Offer
from ...agent.method import system_message
from ...agent.prompt import instruction
from ...agent.situation import Situation
from ...feedback.rounding import SHOWN_DIGITS, rounded

_BESIDE = """\
A least-squares fit works beside you; you decide what to try. A point of yours that is clearly better than the fit's \
becomes the fit's and costs nothing of the simulations you may spend. Where the fit stands, "the_record" leaves open, \
merely narrows, or moves only together the parameters named there, and fixes all others{near}.
Let the fit go on while its misfit falls. Step in when it is slow, when simulations fail or a step has vanished, or \
when you see a cause that it cannot see."""

_NEAR = ". Near the noise, as here, open ones are no causes"
_NEAR_THE_NOISE = 3.0
"""Misfit in tolerances below which what the record leaves open can be told from what is merely far off."""


def build_messages(situation: Situation, offer: Offer, numerics: Mapping[str, Any]) -> list[Message]:
    """The conversation that asks for the next action."""
    if RECORD in numerics:
        # It says from all residuals and their noise what the slopes of the features can only suggest.
        situation = _without(situation, SENSITIVITIES, ALIKE)
    if situation.sensitivities.effects.keys() >= set(situation.task.space.names):
        # Measured effects say which way each parameter acts here, and how much.
        situation = _without(situation, PRIORS, "rules")
    near = _NEAR if situation.base.misfit < _NEAR_THE_NOISE else ""
    # By the numbers of the parameters where the task's table has them.
    names = situation.task.space.names if situation.remembers else ()
    numerics = {key: numbered(value, names) if key == RECORD else value for key, value in numerics.items()}
    sections = [*situation.sections(), section(NUMERICS, rounded(numerics, SHOWN_DIGITS))]
    told = instruction(offer, situation.task.domain.gentler)
    sections.append(f"{title(INSTRUCTION)}{_BESIDE.replace('{near}', near)}\n{told}")
    system = system_message(situation.task, situation.base, offer.reasoning)
    return [system, Message("user", "\n\n".join(sections), situation.images)]


def _without(situation: Situation, title: str, key: str) -> Situation:
    """The situation whose section of that title leaves out what stands under a key."""
    parts = [
        replace(part, content={name: value for name, value in part.content.items() if name != key})
        if part.title == title
        else part
        for part in situation.recollections
    ]
    return replace(situation, recollections=tuple(parts))
