"""Rows of short levels that jump from one to the next are one drive cycle."""

from dataclasses import replace
from itertools import pairwise

from ..trajectory import StepKind
from .levels import Level, RecordSignals, span

DRIVE_LEVELS = 8
"""A drive cycle has at least this many short levels."""

DRIVE_BRIDGE_S = 300.0
"""A level between two drives is part of the drive when it is shorter than this, in s."""

PULSE_TRAIN = 200
"""More short levels than this without a long rest are one drive, even if rests separate them."""


def with_drives(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Join rows of short levels that jump from one to the next into drives."""
    joined: list[Level] = []
    row: list[Level] = []
    for level in [*levels, None]:
        if level is not None and not level.long:
            row.append(level)
            continue
        joined.extend(_drive(signals, row))
        row = []
        if level is not None:
            joined.append(level)
    return _bridge_drives(signals, joined)


def _drive(signals: RecordSignals, row: list[Level]) -> list[Level]:
    flowing = [level for level in row if level.sign != 0]
    jumps = sum(1 for one, two in pairwise(row) if one.sign != 0 and two.sign != 0)
    varied = len(flowing) >= DRIVE_LEVELS and jumps >= max(4, 0.3 * len(flowing))
    if not (varied or len(flowing) > PULSE_TRAIN):
        return row
    # The rests before and after are not part of what was driven.
    first = next(k for k, level in enumerate(row) if level.sign != 0)
    last = next(k for k in range(len(row) - 1, -1, -1) if row[k].sign != 0)
    drive = replace(signals.level(row[first].start, row[last].stop, 1), kind=StepKind.DRIVE)
    return [*row[:first], drive, *row[last + 1 :]]


def _bridge_drives(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    joined: list[Level] = []
    for level in levels:
        joined.append(level)
        if level.kind is not StepKind.DRIVE:
            continue
        back = next(
            (k for k in range(len(joined) - 2, max(-1, len(joined) - 6), -1) if joined[k].kind is StepKind.DRIVE), None
        )
        if back is None:
            continue
        between = joined[back + 1 : -1]
        if sum(piece.seconds for piece in between) < DRIVE_BRIDGE_S:
            whole = span(signals, joined[back], level)
            del joined[back:]
            joined.append(whole)
    return joined
