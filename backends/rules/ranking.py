"""Ranks effects that a model may lack by what their signatures share with a discrepancy told in words."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ...core.messages import Message

_TOPICS = {
    "rest": r"\brest\b|relax|recover",
    "the edge of a step": r"0-2 s|2-30 s|at once|seconds?\b|edges?\b|every current step",
    "minutes after a step": r"\d min\b|minutes?\b",
    "high rate": r"over 1\.5C|high (rate|current)|square of the rate|grows? (faster )?.*with the rate",
    "low rate": r"0\.02-0\.3C|low rate",
    "time": r"growing with time|the longer|pace per hour|square root of time|builds? up",
    "cycles": r"\bcycle \d|cycle by cycle|cycle to cycle|capacity lost|capacity and",
    "charge": r"\bCC charge|CV\b|fast or cold charge|charge (goes|that appears) ",
    "a voltage above the model": r"above the model|rises above",
    "a drive cycle": r"\bdrive",
}
"""What both may speak of, as patterns; names of effects play no part."""


def rank(messages: Sequence[Message], most: int) -> dict[str, Any]:
    """A ranking of the effects that the last message lists, ``most`` at most.

    That message is JSON with ``discrepancy``, sentences, and ``effects``, each with ``name`` and ``signature``. A topic
    counts the more, the fewer signatures speak of it. Where nothing is shared the order of the list stays.
    """
    prompt: Mapping[str, Any] = json.loads(messages[-1].text)
    seen = _topics(" ".join(prompt["discrepancy"]))
    told = {str(effect["name"]): _topics(str(effect["signature"])) for effect in prompt["effects"]}
    counts = {topic: sum(topic in topics for topics in told.values()) for topic in _TOPICS}

    def weight(name: str) -> float:
        return sum(math.log(1 + len(told) / counts[topic]) for topic in told[name] & seen)

    best = sorted(told, key=lambda name: -weight(name))[:most]
    return {
        "analysis": f"the discrepancy speaks of {', '.join(sorted(seen)) or 'nothing that signatures speak of'}",
        "ranking": [{"name": name, "reason": _reason(told[name] & seen)} for name in best],
    }


def _topics(text: str) -> set[str]:
    return {topic for topic, pattern in _TOPICS.items() if re.search(pattern, text)}


def _reason(shared: set[str]) -> str:
    if not shared:
        return "nothing in its signature speaks against it"
    return f"its signature speaks of {', '.join(sorted(shared))}, and so does the discrepancy"
