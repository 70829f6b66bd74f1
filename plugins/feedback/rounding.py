"""Numbers as they go into a prompt."""

from typing import Any

from ...core.numbers import json_ready

DIGITS = 4
"""Digits that are kept of what a trial showed: trials near each other must differ in them."""

SHOWN_DIGITS = 3
"""Digits of a mismatch that a reader can use."""


def rounded(value: Any, digits: int = DIGITS) -> Any:
    """A JSON-ready copy with every float rounded to significant digits; non-finite ones become None."""
    return json_ready(value, digits)
