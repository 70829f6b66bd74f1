"""Rows of short levels that jump from one to the next are one drive cycle."""

from dataclasses import replace
from itertools import groupby, pairwise

from ..trajectory import StepKind
from .levels import Level, RecordSignals, span

DRIVE_LEVELS = 8
"""A drive cycle has at least this many short levels."""

DRIVE_BRIDGE_S = 300.0
"""A level between two drives is part of the drive when it is shorter than this, in s."""

_BRIDGED = 4
"""Levels before a drive among which the last drive is looked for."""

PULSE_TRAIN = 200
"""More short levels than this without a long rest are one drive, even if rests separate them."""


def with_drives(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Join rows of short levels that jump from one to the next into drives."""
    joined: list[Level] = []
    for long, found in groupby(levels, key=lambda level: level.long):
        row = list(found)
        joined += row if long else _drive(signals, row)
    return _bridge_drives(signals, joined)


def _drive(signals: RecordSignals, row: list[Level]) -> list[Level]:
    flowing = [place for place, level in enumerate(row) if level.sign != 0]
    jumps = sum(1 for one, two in pairwise(row) if one.sign != 0 and two.sign != 0)
    varied = len(flowing) >= DRIVE_LEVELS and jumps >= max(4, 0.3 * len(flowing))
    if not (varied or len(flowing) > PULSE_TRAIN):
        return row
    # The rests before and after are not part of what was driven.
    first, last = flowing[0], flowing[-1]
    drive = replace(signals.level(row[first].start, row[last].stop, 1), kind=StepKind.DRIVE)
    return [*row[:first], drive, *row[last + 1 :]]


def _bridge_drives(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    joined: list[Level] = []
    for level in levels:
        near = range(max(0, len(joined) - _BRIDGED), len(joined))
        drives = [place for place in near if joined[place].kind is level.kind is StepKind.DRIVE]
        if drives and sum(piece.seconds for piece in joined[drives[-1] + 1 :]) < DRIVE_BRIDGE_S:
            joined[drives[-1] :] = [span(signals, joined[drives[-1]], level)]
        else:
            joined.append(level)
    return joined
