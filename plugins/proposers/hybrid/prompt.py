"""What the hybrid's agent is told: as the agent is, and what the numerical fit is doing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ....core.messages import Message
from ....core.prompt_sections import INSTRUCTION, NUMERICS, section, title
from ...agent.actions import Offer
from ...agent.method import system_message
from ...agent.prompt import instruction
from ...agent.situation import Situation
from ...feedback.rounding import rounded

_BESIDE = """\
A least-squares fit works beside you and does the arithmetic; you decide what to try. "asked_by" tells its trials from \
yours. A point of yours that is clearly better than the fit's becomes the fit's at once and does not count \
against your share of the simulations. That share stands under Numerics, and "the_record" there says which parameters \
the record fixes, leaves open, or moves only together where the fit stands{near}.
Let the fit go on while it gets on. Step in when it is slow, when simulations fail or a step has vanished, or when \
you see a cause that it cannot see."""

_NEAR = ": near the noise, as here, open ones are no causes"
_NEAR_THE_NOISE = 3.0
"""Misfit in tolerances below which what the record leaves open can be told from what is merely far off."""


def build_messages(situation: Situation, offer: Offer, numerics: Mapping[str, Any]) -> list[Message]:
    """The conversation that asks for the next action."""
    near = _NEAR if situation.base.misfit < _NEAR_THE_NOISE else ""
    sections = [*situation.sections(), section(NUMERICS, rounded(dict(numerics)))]
    told = instruction(offer, situation.task.domain.gentler)
    sections.append(f"{title(INSTRUCTION)}{_BESIDE.replace('{near}', near)}\n{told}")
    system = system_message(situation.task, situation.base, offer.analysis_chars > 0)
    return [system, Message("user", "\n\n".join(sections), situation.images)]
