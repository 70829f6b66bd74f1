"""What the records fix, in the words that the command line and the report share."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.appraisal import Appraisal, Suggestion
from .report.wording import number, short_name


def verdict_line(appraisal: Appraisal) -> str:
    """``"The record fixes 4 of 7 parameters; loose: ...; open: ..."``."""
    found = appraisal.identifiability
    parts = [f"The record fixes {len(found.fixed)} of {len(found.intervals)} parameters"]
    if found.loose:
        parts.append(f"loose: {named(found.loose)}")
    if found.open:
        parts.append(f"open: {named(found.open)}")
    return "; ".join(parts) + "."


def caution_line(appraisal: Appraisal) -> str:
    """Why the intervals are not to be trusted; empty if nothing speaks against them."""
    if not appraisal.unsettled:
        return ""
    return (
        f"The fit has not settled: {named(appraisal.unsettled)} would move by more than the interval with another "
        "step, so the intervals are too narrow. More simulations would tell."
    )


def groups_line(appraisal: Appraisal) -> str:
    """Which parameters cannot be told apart; empty if all can."""
    groups = [named(group) for group in appraisal.identifiability.correlated]
    return f"Known only together: {'; '.join(groups)}." if groups else ""


def next_line(appraisal: Appraisal) -> str:
    """What to measure next and what it would do; empty if nothing was found that helps."""
    if not appraisal.measure_next:
        return ""
    first = appraisal.measure_next[0]
    now = appraisal.identifiability.intervals[appraisal.worst].share_of_range
    if first.forecast.worst_share >= now:
        return "None of the protocols considered would shrink the widest interval."
    return (
        f"To measure next: {first.name} ({number(first.hours, 2)} h from full): the widest 95 % interval would go "
        f"from {share(now)} of its range ({short_name(appraisal.worst)}) to {share(first.forecast.worst_share)} "
        f"({short_name(first.forecast.worst)})."
    )


def steps_of(suggestion: Suggestion) -> str:
    """The steps of a protocol in a line, a repeated pair of steps once."""
    cycles = []
    for cycle in suggestion.protocol:
        times = len(cycle) // 2 if len(cycle) > 2 and cycle == cycle[:2] * (len(cycle) // 2) else 1
        steps = cycle[:2] if times > 1 else cycle
        cycles.append(", ".join(steps) + (f"; {times} times" if times > 1 else ""))
    return "; then ".join(cycles)


def share(half_width: float) -> str:
    """Half an interval's width as it is told: ``"± 12 %"``; an interval may be wider than the range."""
    return f"± {number(100.0 * half_width, 2)} %"


def named(names: Sequence[str]) -> str:
    """Parameters by their short names."""
    return ", ".join(short_name(name) for name in names)
