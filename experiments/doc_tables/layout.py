"""How numbers and tables are written in the documentation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..campaign.summary import Statistic, statistic


def short(value: float) -> str:
    """A number to two or three digits."""
    if math.isnan(value):
        return "–"
    if value == 0:
        return "0"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}" if abs(value) >= 10 else f"{value:.2g}"


def spread(values: Sequence[float] | Statistic) -> str:
    """Mean ± sample standard deviation (n - 1)."""
    found = values if isinstance(values, Statistic) else statistic(values)
    text = short(found.mean) if math.isnan(found.deviation) else f"{short(found.mean)} ± {short(found.deviation)}"
    return f"{text} ({found.missing} without result)" if found.missing else text


def bold(text: str, when: bool = True) -> str:
    """The text, bold where something holds."""
    return f"**{text}**" if when else text
