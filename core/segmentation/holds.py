"""Levels that fall one after the other while the voltage stands still are one constant-voltage hold."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..normal import robust_deviation
from ..trajectory import StepKind
from .levels import BRIEF_S, LONG_SAMPLES, Level, RecordSignals, span

HOLD_BAND_V = 0.012
"""How far the voltage may wander during a constant-voltage hold, in V (NASA's cycler drifts by 8 mV)."""

VOLTAGE_NOISE_V = 0.003
"""Scatter of the voltage above this is taken for signal, not noise, in V."""

HOLD_RISE = 0.04
"""A noisy cycler may raise the current of a hold by this share for a while."""

HOLD_RESOLVED = 0.002
"""The same by this share of the record's largest current, twice what cyclers are accurate to: near its end a hold has
a hundredth of that current."""

HOLD_DECAY = 0.9
"""The current of a hold falls at least to this share of where it began."""


def with_holds(signals: RecordSignals, levels: list[Level], earlier: Level | None = None) -> list[Level]:
    """Join levels that fall while the voltage stands still, from the end of each stretch of one sign backwards.

    ``earlier`` is the level before the first one, if there is any.
    """
    band = HOLD_BAND_V + 4.0 * min(signals.voltage_noise, VOLTAGE_NOISE_V)
    pieces = [signals.voltage[level.start : level.stop] for level in levels]
    extremes = [(float(piece.min()), float(piece.max())) for piece in pieces]
    joined: list[Level] = []
    end = len(levels) - 1
    while end >= 0:
        begin = end
        low, high = extremes[end]
        while levels[end].sign != 0 and begin > 0 and levels[begin - 1].sign == levels[end].sign:
            before = levels[begin - 1]
            wider = min(low, extremes[begin - 1][0]), max(high, extremes[begin - 1][1])
            # Both levels may be single samples.
            scatter = float(np.hypot(signals.tolerance(before.mean), signals.tolerance(levels[begin].mean)))
            slack = max(HOLD_RISE * abs(before.mean), HOLD_RESOLVED * signals.scale, scatter)
            falling = abs(before.mean) >= abs(levels[begin].mean) - slack
            if not falling or wider[1] - wider[0] > band:
                break
            low, high = wider
            begin -= 1
        joined.extend(reversed(_hold(signals, levels, begin, end, levels[begin - 1] if begin else earlier)))
        end = begin - 1
    joined.reverse()
    return _begin_holds(signals, _same_holds(signals, joined, band))


def _hold(signals: RecordSignals, levels: list[Level], begin: int, end: int, earlier: Level | None) -> list[Level]:
    """The levels as one hold if they are one, else as they are; ``earlier`` is the level before them."""
    start, stop = levels[begin].start, levels[end].stop
    first, last = abs(signals.current[start]), abs(signals.current[stop - 1])
    # A few falling samples at one voltage happen by chance in a drive; after constant current they are a hold.
    follows = earlier is not None and earlier.sign == levels[begin].sign and earlier.long
    samples = LONG_SAMPLES if follows else 2 * LONG_SAMPLES
    enough = stop - start >= samples and signals.seconds(start, stop) >= BRIEF_S
    if begin == end or not enough or last > HOLD_DECAY * first or first - last < 6.0 * signals.noise:
        return levels[begin : end + 1]
    return [replace(signals.level(start, stop, levels[begin].sign), kind=StepKind.CV_HOLD)]


def _same_holds(signals: RecordSignals, levels: list[Level], band: float) -> list[Level]:
    """Join neighbouring holds at one voltage, which a slow drift of the cycler had parted."""
    joined: list[Level] = []
    for level in levels:
        if joined and joined[-1].kind is level.kind is StepKind.CV_HOLD and joined[-1].sign == level.sign:
            ends = signals.voltage[level.start - 1], signals.voltage[level.start]
            if abs(ends[1] - ends[0]) <= 0.5 * band:
                joined[-1] = span(signals, joined[-1], level)
                continue
        joined.append(level)
    return joined


def _begin_holds(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Give the first part of each decay, which still counted as constant current, back to its hold."""
    for before, hold in pairwise(levels):
        if hold.kind is not StepKind.CV_HOLD or before.sign != hold.sign or before.samples < 3:
            continue
        size = np.abs(signals.current[before.start : before.stop])
        plateau = float(np.median(size))
        scatter = robust_deviation(size - plateau)
        # The decay begins after the last sample that still reaches the plateau.
        cut = before.start + int(np.flatnonzero(size >= plateau - 2.0 * scatter)[-1]) + 1
        if cut < before.stop and before.kind is None:
            before.stop, hold.start = cut, cut
            before.seconds = signals.seconds(before.start, cut)
            hold.seconds = signals.seconds(hold.start, hold.stop)
    return levels
