"""Numbers as they go into a prompt: four digits say all that a reader can use."""

from __future__ import annotations

import math
from typing import Any

DIGITS = 4


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
