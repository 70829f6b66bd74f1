"""Numbers as they go into a prompt."""

import math
from typing import Any

DIGITS = 4
"""Digits that are kept of what a trial showed: trials near each other must differ in them."""

SHOWN_DIGITS = 3
"""Digits of a mismatch that a reader can use."""


def rounded(value: Any, digits: int = DIGITS) -> Any:
    """A JSON-ready copy with every float rounded to significant digits; non-finite ones become None."""
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): rounded(item, digits) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(item, digits) for item in value]
    return rounded(float(value), digits)
