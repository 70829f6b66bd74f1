"""The sections of a prompt: their headings, and how one is written and read."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

TASK = "Task"
PRIORS = "Priors"
FEEDBACK = "Feedback"
LAST_ATTEMPT = "Last attempt, no better"
NUMERICS = "Numerics"
INSTRUCTION = "What to do"

MEMORY = "Memory"
"""Sections whose heading begins with this may be left out of a prompt that is too long."""

TRIALS = f"{MEMORY}: trials so far"
SENSITIVITIES = f"{MEMORY}: learnt sensitivities"

_SECTION = re.compile(r"^## (?P<heading>[^\n]+)\n```json\n(?P<body>.*?)\n```", re.DOTALL | re.MULTILINE)
_START = re.compile(r"(?m)^(?=## )")


def section(heading: str, content: Mapping[str, Any]) -> str:
    """A heading and a fenced JSON block."""
    return f"{title(heading)}```json\n{json.dumps(content, ensure_ascii=False)}\n```"


def title(heading: str) -> str:
    """The line of a heading."""
    return f"## {heading}\n"


def read_sections(text: str) -> list[tuple[str, Any]]:
    """Heading and JSON content of every section in order; what is no JSON is left out."""
    found: list[tuple[str, Any]] = []
    for match in _SECTION.finditer(text):
        try:
            found.append((match["heading"], json.loads(match["body"])))
        except (ValueError, RecursionError):
            continue
    return found


def without_first_memory(text: str) -> tuple[str, str] | None:
    """The text without its first section headed `MEMORY`, and that section's heading; None if it has none."""
    sections = _START.split(text)
    for index, part in enumerate(sections):
        heading = part.partition("\n")[0].removeprefix("## ")
        if part.startswith("## ") and heading.startswith(MEMORY):
            return "".join(sections[:index] + sections[index + 1 :]), heading
    return None
