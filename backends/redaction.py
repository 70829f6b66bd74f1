"""Takes keys out of any text that could reach a screen, a journal or a report."""

from __future__ import annotations

import os
import re

_SECRET_NAME = re.compile(r"(KEY|TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIALS?)$", re.IGNORECASE)
_SHORTEST_SECRET = 8
# What keys look like, for those that stand elsewhere than in the environment.
_SECRET_SHAPE = re.compile(
    r"(?<=Bearer )[^\s\"',]{8,}"
    r"|\b(?:sk|pk|gsk|hf|xai|tgp|fw)[-_][A-Za-z0-9_\-]{12,}"
    r"|(?<=://)[^/\s@:]+:[^/\s@]+(?=@)"
)
REDACTED = "[redacted]"


def redact(text: str) -> str:
    """The text without the values of the environment's keys, and without anything shaped like a key."""
    for name, value in os.environ.items():
        if len(value) >= _SHORTEST_SECRET and _SECRET_NAME.search(name):
            text = text.replace(value, REDACTED)
    return _SECRET_SHAPE.sub(REDACTED, text)
