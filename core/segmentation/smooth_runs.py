"""Joins levels that run into each other, closes glitches, and gives the samples of a switch to the step beside it."""

from dataclasses import replace

from .levels import LEVEL_SHARE, LONG_SAMPLES, Level, RecordSignals, span

RAMP_S = 2.0
"""A current that rises for no longer than this to a constant one is being switched on (Arbin: 0.5 to 0.7 s), in s."""


def smoothed(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Join levels without a jump between them, and close glitches of one or two samples."""
    joined: list[Level] = []
    for level in levels:
        joined.append(level)
        while len(joined) >= 2 and _continues(signals, joined[-2], joined[-1]):
            last = joined.pop()
            joined[-1] = span(signals, joined[-1], last)
        if len(joined) >= 3 and _bridges(signals, *joined[-3:]):
            last = joined.pop()
            joined.pop()
            joined[-1] = span(signals, joined[-1], last)
    return joined


def _continues(signals: RecordSignals, before: Level, after: Level) -> bool:
    if not _may_be_one(before, after):
        return False
    if abs(before.mean - after.mean) <= 0.5 * signals.tolerance(before.mean):
        return True
    jump = abs(signals.current[after.start] - signals.current[after.start - 1])
    drifting = min(before.samples, after.samples) >= LONG_SAMPLES
    return drifting and bool(jump <= max(0.5 * LEVEL_SHARE * abs(before.mean), 5.0 * signals.noise))


def _bridges(signals: RecordSignals, before: Level, glitch: Level, after: Level) -> bool:
    if glitch.samples > 2 or not _may_be_one(before, after):
        return False
    spacing = (before.seconds + after.seconds) / (before.samples + after.samples)
    brief = glitch.seconds <= 2.5 * max(spacing, 1.0)
    return brief and abs(before.mean - after.mean) <= signals.tolerance(before.mean)


def _may_be_one(before: Level, after: Level) -> bool:
    """Whether both are of one sign and unnamed, and one is long: samples of a drive may agree by chance."""
    return before.sign == after.sign != 0 and not (before.kind or after.kind) and (before.long or after.long)


def without_ramps(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Give the samples of a current that a cycler ramps up to a constant one to the long step that follows."""
    joined: list[Level] = []
    for level in levels:
        first, after = len(joined), level
        while level.long and level.sign != 0 and first > 0 and _rises(joined[first - 1], after):
            first -= 1
            after = joined[first]
        if after is not level and signals.time[level.start] - signals.time[after.start] <= RAMP_S:
            level = _begun_at(signals, level, after.start)
            del joined[first:]
        joined.append(level)
    return joined


def _rises(before: Level, after: Level) -> bool:
    short = before.kind is None and not before.long
    return short and before.sign == after.sign and abs(before.mean) < abs(after.mean)


def _begun_at(signals: RecordSignals, level: Level, start: int) -> Level:
    return replace(level, start=start, seconds=signals.seconds(start, level.stop))


def without_edges(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Give the one or two samples caught in the middle of a switch to the long step they belong to."""
    joined: list[Level] = []
    pending: int | None = None
    for before, level, after in zip([None, *levels], levels, [*levels[1:], None], strict=False):
        if pending is not None:
            level = _begun_at(signals, level, pending)
            pending = None
        short = level.sign != 0 and level.samples <= 2 and not level.kind and not level.long
        caught = short and _calm(before) and _calm(after)
        if caught and after is not None and after.sign != 0:
            pending = level.start
        elif caught and before is not None and before.sign != 0:
            joined[-1] = replace(joined[-1], stop=level.stop, seconds=signals.seconds(joined[-1].start, level.stop))
        else:
            joined.append(level)
    return joined


def _calm(level: Level | None) -> bool:
    """Whether a level is none, a rest, or long: beside anything else a short level may be part of a drive."""
    return level is None or level.sign == 0 or level.long
