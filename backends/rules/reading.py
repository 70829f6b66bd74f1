"""Reads a prompt as a language model would see it: headings and fenced JSON blocks, nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...core.messages import Message

_SECTION = re.compile(r"^## (?P<title>[^\n]+)\n```json\n(?P<body>.*?)\n```", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Prompt:
    """What the prompt says, by section.

    Attributes
    ----------
    parameters : dict of str to float
        The searched parameters and their current values.
    steps : dict of str to str
        A change of each parameter that is worth trying, ``"*1.1"`` or ``"+0.03"``.
    feedback : dict
        The feedback on the current values.
    overshot : bool
        Whether the latest attempt was no better.
    effects : dict of str to dict
        Learnt sensitivities: change of each feature per typical step of each parameter; empty without memory.
    trials : list of dict
        Earlier trials with ``values`` and ``features`` or residuals; empty without memory.
    rules : list of dict
        Domain rules; empty without priors.
    bounds : dict of str to (lower, upper)
        Bounds; empty without priors.
    numerics : dict
        What the numerical fit beside the agent is doing; empty where there is none.
    """

    parameters: dict[str, float]
    steps: dict[str, str]
    feedback: dict[str, Any]
    overshot: bool = False
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    trials: list[dict[str, Any]] = field(default_factory=list)
    trial_features: list[str] = field(default_factory=list)
    rules: list[dict[str, Any]] = field(default_factory=list)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    numerics: dict[str, Any] = field(default_factory=dict)

    @property
    def features(self) -> dict[str, float]:
        """The numbers that are to become zero: features, or residuals where there are no others."""
        found = self.feedback.get("features") or self.feedback.get("residuals") or {}
        return {name: float(value) for name, value in found.items() if isinstance(value, (int, float))}


def read_prompt(messages: Sequence[Message]) -> Prompt:
    """The sections of the first user message; later turns hold only complaints about replies."""
    text = next((message.text for message in messages if message.role == "user"), "")
    sections: dict[str, Any] = {}
    for match in _SECTION.finditer(text):
        try:
            sections[match["title"]] = json.loads(match["body"])
        except json.JSONDecodeError:
            continue
    parameters = sections.get("Task", {}).get("parameters", {})
    history = sections.get("Memory: trials so far", {})
    priors = sections.get("Priors", {})
    return Prompt(
        parameters={name: float(entry["current"]) for name, entry in parameters.items()},
        steps={name: str(entry["typical_step"]) for name, entry in parameters.items()},
        feedback=sections.get("Feedback", {}),
        overshot=any(title.startswith("Last attempt") for title in sections),
        effects=sections.get("Memory: learnt sensitivities", {}).get("effects", {}),
        trials=history.get("trials", []),
        trial_features=history.get("features", []),
        rules=priors.get("rules", []),
        bounds={name: (float(low), float(high)) for name, (low, high) in priors.get("bounds", {}).items()},
        numerics=sections.get("Numerics", {}),
    )
