"""Cuts a record into the steps a cycler would name, from its current and voltage alone.

The cut goes from fine to coarse, each pass in time proportional to the number of samples:

1. *Signs*: samples are at rest, charging or discharging, with hysteresis so that noise does not flicker.
2. *Levels*: each stretch of one sign is cut wherever the current leaves its running mean.
3. *Holds*: levels that fall one after the other while the voltage stands still are one constant-voltage hold.
4. *Smooth runs*: levels that run into each other without a jump (a drifting current) are joined, and
   a glitch of one or two samples between equal levels is closed.
5. *Drive cycles*: many short levels that follow each other are one drive.
6. *Names*: what is left is a pulse or a constant-current step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .trajectory import SECONDS_PER_HOUR, FloatArray, Step, StepKind, Trajectory

Signs = NDArray[np.int8]

REST_SHARE = 0.005
"""A current below this share of the largest one is a rest, unless noise asks for more."""

REST_SHARE_NOISY = 0.025
"""The largest share of the current that noise may turn into a rest."""

LEVEL_SHARE = 0.015
"""A current this share away from the running mean starts a new level."""

NOISE_SHARE = 0.008
"""Scatter above this share of the largest current is taken for signal, not noise."""

HOLD_BAND_V = 0.012
"""How far the voltage may wander during a constant-voltage hold, in V (NASA's cycler drifts by 8 mV)."""

VOLTAGE_NOISE_V = 0.003
"""Scatter of the voltage above this is taken for signal, not noise, in V."""

HOLD_RISE = 0.04
"""A noisy cycler may raise the current of a hold by this share for a while."""

HOLD_DECAY = 0.9
"""The current of a hold falls at least to this share of where it began."""

LONG_S = 120.0
"""A level is a step of its own when it lasts this long and holds at least `LONG_SAMPLES`, in s."""

LONG_SAMPLES = 4

PULSE_S = 60.0
"""A constant current that lasts no longer than this beside a rest is a pulse, in s."""

DRIVE_LEVELS = 8
"""A drive cycle has at least this many short levels."""

DRIVE_BRIDGE_S = 300.0
"""A level between two drives is part of the drive when it is shorter than this, in s."""

PULSE_TRAIN = 200
"""More short levels than this without a long rest are one drive, even if rests separate them."""

CYCLE_SHARE = 0.02
"""A step counts as a charge or discharge for cycles when it moves this share of the largest step's charge."""


@dataclass(slots=True)
class _Level:
    """Samples ``start`` to ``stop - 1`` of one sign, at one mean current."""

    start: int
    stop: int
    sign: int
    mean: float
    seconds: float
    kind: StepKind | None = None

    @property
    def samples(self) -> int:
        return self.stop - self.start

    @property
    def long(self) -> bool:
        return self.seconds >= LONG_S and self.samples >= LONG_SAMPLES


@dataclass(frozen=True)
class _Record:
    """The signals with the scales that the passes share."""

    time: FloatArray
    current: FloatArray
    voltage: FloatArray
    scale: float
    noise: float
    voltage_noise: float

    def tolerance(self, mean: float) -> float:
        """How far a sample may lie from the mean of its level, in A."""
        return max(LEVEL_SHARE * abs(mean), 5.0 * self.noise)

    def seconds(self, start: int, stop: int) -> float:
        """How long the samples last; the last one counts for no more than its neighbours, so a gap adds nothing."""
        inside = float(self.time[stop - 1] - self.time[start])
        if stop >= len(self.time):
            return inside
        after = float(self.time[stop] - self.time[stop - 1])
        return inside + (min(after, inside / (stop - start - 1)) if stop - start >= 3 else after)

    def level(self, start: int, stop: int, sign: int) -> _Level:
        mean = float(np.mean(self.current[start:stop]))
        return _Level(start, stop, sign, mean, self.seconds(start, stop))


def segment(trajectory: Trajectory) -> Trajectory:
    """Cut a record into steps and number its cycles.

    Parameters
    ----------
    trajectory : Trajectory
        Any record; steps that it already has are ignored.

    Returns
    -------
    Trajectory
        The same samples with consecutive steps that cover all of them.

    Notes
    -----
    Current steps at constant power drift and are named `StepKind.DRIVE`, since only their measured current
    describes them. A pulse too short for the sampling, or whose current was not logged (the internal-resistance
    pulse of Arbin cyclers), stays part of its rest.

    A new cycle starts with the first step that carries charge in the direction of the record's first such step
    after one in the opposite direction: a record that begins with a charge counts charges, one that begins
    with a discharge counts discharges. Rests and pulses belong to the cycle that went before, a leading rest to
    cycle 1. Steps that move less than 2 % of the largest step's charge start nothing.
    """
    if len(trajectory) == 0:
        return replace(trajectory, steps=())
    record = _scales(trajectory)
    levels = _levels(record, _signs(record))
    levels = _holds(record, levels)
    levels = _smooth(record, levels)
    levels = _edges(record, levels)
    levels = _drives(record, levels)
    _name(record, levels)
    return replace(trajectory, steps=_numbered(trajectory, levels))


def _scatter(values: FloatArray) -> float:
    """Standard deviation of the noise on a slowly varying signal; its steps and drives do not count."""
    if len(values) < 3:
        return 0.0
    # The lower quartile of |difference| of Gaussian noise is 0.3186 sqrt(2) of its standard deviation.
    return float(np.quantile(np.abs(np.diff(values)), 0.25) / (0.3186 * np.sqrt(2.0)))


def _scales(trajectory: Trajectory) -> _Record:
    current, voltage = trajectory.current, trajectory.voltage
    scale = float(np.max(np.abs(current)))
    # One wild sample in a thousand must not set the scale, but short pulses must.
    if len(current) >= 1000:
        scale = min(scale, 3.0 * float(np.quantile(np.abs(current), 0.999)) or scale)
    everywhere = _scatter(current)
    if scale == 0.0 or (scale < 6.0 * everywhere and not _moves_voltage(current, voltage)):
        # Nothing, or noise around zero: one long rest.
        return _Record(trajectory.time, current, voltage, np.inf, 0.0, _scatter(voltage))
    flowing = current[np.abs(current) > max(REST_SHARE * scale, 4.0 * min(everywhere, NOISE_SHARE * scale))]
    noise = min(max(everywhere, _scatter(flowing)), NOISE_SHARE * scale)
    return _Record(trajectory.time, current, voltage, scale, noise, _scatter(voltage))


def _moves_voltage(current: FloatArray, voltage: FloatArray) -> bool:
    """Whether changes of the current show in the voltage, as they do in a drive but not in noise."""
    if len(current) < 3:
        return True
    steps, answers = np.diff(current), np.diff(voltage)
    size = float(np.sqrt(np.sum(steps**2) * np.sum(answers**2)))
    # A steady current has noise of either sign, but its mean stands clear of zero.
    steady = abs(float(np.mean(current))) > 3.0 * float(np.std(current))
    return steady or (size > 0.0 and float(-np.sum(steps * answers)) / size > 0.3)


def _signs(record: _Record) -> Signs:
    """-1 (charge), 0 (rest) or 1 (discharge) for each sample."""
    share = np.clip(5.0 * record.noise / record.scale, REST_SHARE, REST_SHARE_NOISY)
    high = share * record.scale if np.isfinite(record.scale) else np.inf
    low = 0.5 * high
    size = np.abs(record.current)
    flowing = np.where(size > 0.0, np.sign(record.current), 0.0).astype(np.int8)
    signs = np.where(size < high, np.int8(0), flowing)
    # Between the two thresholds a sample keeps the state of the sample before it, if the sign agrees and the
    # current did not fall there in one go.
    unsure = (size >= low) & (size < high) & (size >= 0.5 * np.concatenate([[np.inf], size[:-1]]))
    known = np.where(unsure, 0, np.arange(len(size)))
    last_known = np.maximum.accumulate(known)
    kept = signs[last_known]
    return _without_specks(np.where(unsure & (kept == flowing), kept, signs), size, 2.5 * high)


def _without_specks(signs: Signs, size: FloatArray, enough: float) -> Signs:
    """Turn one or two small samples in the midst of a rest into rest: noise has its rare large moments."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(signs)) + 1, [len(signs)]])
    for k in np.flatnonzero((np.diff(edges) <= 2) & (signs[edges[:-1]] != 0)):
        start, stop = edges[k], edges[k + 1]
        alone = (start == 0 or signs[start - 1] == 0) and (stop == len(signs) or signs[stop] == 0)
        if alone and size[start:stop].max() < enough:
            signs[start:stop] = 0
    return signs


def _levels(record: _Record, signs: Signs) -> list[_Level]:
    """Stretches of one sign, cut wherever the current leaves its running mean."""
    edges = [0, *(np.flatnonzero(np.diff(signs)) + 1).tolist(), len(signs)]
    currents = record.current.tolist()
    levels: list[_Level] = []
    floor = 5.0 * record.noise
    for first, last in pairwise(edges):
        sign = int(signs[first])
        if sign == 0:
            levels.append(record.level(first, last, 0))
            continue
        start, mean = first, currents[first]
        for k in range(first + 1, last):
            value = currents[k]
            if abs(value - mean) > max(LEVEL_SHARE * abs(mean), floor):
                levels.append(_Level(start, k, sign, mean, record.seconds(start, k)))
                start, mean = k, value
            else:
                mean += (value - mean) / (k - start + 1)
        levels.append(_Level(start, last, sign, mean, record.seconds(start, last)))
    return levels


def _holds(record: _Record, levels: list[_Level]) -> list[_Level]:
    """Join levels that fall while the voltage stands still, from the end of each stretch of one sign backwards."""
    band = HOLD_BAND_V + 4.0 * min(record.voltage_noise, VOLTAGE_NOISE_V)
    extremes = [
        (float(piece.min()), float(piece.max()))
        for piece in (record.voltage[level.start : level.stop] for level in levels)
    ]
    joined: list[_Level] = []
    end = len(levels) - 1
    while end >= 0:
        begin = end
        low, high = extremes[end]
        while levels[end].sign != 0 and begin > 0 and levels[begin - 1].sign == levels[end].sign:
            before = levels[begin - 1]
            wider = min(low, extremes[begin - 1][0]), max(high, extremes[begin - 1][1])
            slack = max(HOLD_RISE * abs(before.mean), record.tolerance(before.mean))
            falling = abs(before.mean) >= abs(levels[begin].mean) - slack
            if not falling or wider[1] - wider[0] > band:
                break
            low, high = wider
            begin -= 1
        joined.extend(reversed(_hold(record, levels, begin, end)))
        end = begin - 1
    joined.reverse()
    return _begin_holds(record, _same_holds(record, joined, band))


def _hold(record: _Record, levels: list[_Level], begin: int, end: int) -> list[_Level]:
    """The levels as one hold if they are one, else as they are."""
    start, stop = levels[begin].start, levels[end].stop
    first, last = abs(record.current[start]), abs(record.current[stop - 1])
    # A few falling samples at one voltage happen by chance in a drive; after constant current they are a hold.
    follows = begin > 0 and levels[begin - 1].sign == levels[begin].sign and levels[begin - 1].long
    samples = LONG_SAMPLES if follows else 2 * LONG_SAMPLES
    enough = stop - start >= samples and record.seconds(start, stop) >= PULSE_S
    if begin == end or not enough or last > HOLD_DECAY * first or first - last < 6.0 * record.noise:
        return levels[begin : end + 1]
    return [replace(record.level(start, stop, levels[begin].sign), kind=StepKind.CV_HOLD)]


def _same_holds(record: _Record, levels: list[_Level], band: float) -> list[_Level]:
    """Join neighbouring holds at one voltage, which a slow drift of the cycler had parted."""
    joined: list[_Level] = []
    for level in levels:
        if joined and joined[-1].kind is level.kind is StepKind.CV_HOLD and joined[-1].sign == level.sign:
            ends = record.voltage[level.start - 1], record.voltage[level.start]
            if abs(ends[1] - ends[0]) <= 0.5 * band:
                joined[-1] = _span(record, joined[-1], level)
                continue
        joined.append(level)
    return joined


def _begin_holds(record: _Record, levels: list[_Level]) -> list[_Level]:
    """Give the first part of each decay, which still counted as constant current, back to its hold."""
    for before, hold in pairwise(levels):
        if hold.kind is not StepKind.CV_HOLD or before.sign != hold.sign or before.samples < 3:
            continue
        size = np.abs(record.current[before.start : before.stop])
        plateau = float(np.median(size))
        scatter = 1.4826 * float(np.median(np.abs(size - plateau)))
        # The decay begins after the last sample that still reaches the plateau.
        cut = before.start + int(np.flatnonzero(size >= plateau - 2.0 * scatter)[-1]) + 1
        if cut < before.stop and before.kind is None:
            before.stop, hold.start = cut, cut
            before.seconds = record.seconds(before.start, cut)
            hold.seconds = record.seconds(hold.start, hold.stop)
    return levels


def _smooth(record: _Record, levels: list[_Level]) -> list[_Level]:
    """Join levels without a jump between them, and close glitches of one or two samples."""
    joined: list[_Level] = []
    for level in levels:
        joined.append(level)
        while len(joined) >= 2 and _continues(record, joined[-2], joined[-1]):
            last = joined.pop()
            joined[-1] = _span(record, joined[-1], last)
        if len(joined) >= 3 and _bridges(record, *joined[-3:]):
            last = joined.pop()
            joined.pop()
            joined[-1] = _span(record, joined[-1], last)
    return joined


def _span(record: _Record, first: _Level, last: _Level) -> _Level:
    """One level from the first to the last; the mean is carried along, so that a long row costs no more."""
    weight = first.samples + last.samples
    mean = (first.mean * first.samples + last.mean * last.samples) / weight
    return _Level(first.start, last.stop, first.sign, mean, record.seconds(first.start, last.stop), first.kind)


def _continues(record: _Record, before: _Level, after: _Level) -> bool:
    if before.sign != after.sign or before.sign == 0 or before.kind or after.kind:
        return False
    # Neighbouring samples of a drive may agree by chance: only a long level takes others in.
    if not (before.long or after.long):
        return False
    if abs(before.mean - after.mean) <= 0.5 * record.tolerance(before.mean):
        return True
    jump = abs(record.current[after.start] - record.current[after.start - 1])
    drifting = min(before.samples, after.samples) >= LONG_SAMPLES
    return drifting and bool(jump <= max(0.5 * LEVEL_SHARE * abs(before.mean), 5.0 * record.noise))


def _bridges(record: _Record, before: _Level, glitch: _Level, after: _Level) -> bool:
    if before.sign != after.sign or before.sign == 0 or glitch.samples > 2 or before.kind or after.kind:
        return False
    if not (before.long or after.long):
        return False
    spacing = (before.seconds + after.seconds) / (before.samples + after.samples)
    brief = glitch.seconds <= 2.5 * max(spacing, 1.0)
    return brief and abs(before.mean - after.mean) <= record.tolerance(before.mean)


def _edges(record: _Record, levels: list[_Level]) -> list[_Level]:
    """Give the one or two samples caught in the middle of a switch to the long step they belong to."""
    joined: list[_Level] = []
    pending: int | None = None
    for index, level in enumerate(levels):
        if pending is not None:
            level = replace(level, start=pending, seconds=record.seconds(pending, level.stop))
            pending = None
        before = levels[index - 1] if index > 0 else None
        after = levels[index + 1] if index + 1 < len(levels) else None
        if level.sign == 0 or level.samples > 2 or level.kind or level.long or not (_calm(before) and _calm(after)):
            joined.append(level)
        elif after is not None and after.sign != 0:
            pending = level.start
        elif before is not None and before.sign != 0:
            joined[-1] = replace(joined[-1], stop=level.stop, seconds=record.seconds(joined[-1].start, level.stop))
        else:
            joined.append(level)
    return joined


def _calm(level: _Level | None) -> bool:
    """Whether a level is none, a rest, or long: beside anything else a short level may be part of a drive."""
    return level is None or level.sign == 0 or level.long


def _drives(record: _Record, levels: list[_Level]) -> list[_Level]:
    """Join rows of short levels that jump from one to the next into drives."""
    joined: list[_Level] = []
    row: list[_Level] = []
    for level in [*levels, None]:
        if level is not None and not level.long:
            row.append(level)
            continue
        joined.extend(_drive(record, row))
        row = []
        if level is not None:
            joined.append(level)
    return _bridge_drives(record, joined)


def _drive(record: _Record, row: list[_Level]) -> list[_Level]:
    flowing = [level for level in row if level.sign != 0]
    jumps = sum(1 for one, two in pairwise(row) if one.sign != 0 and two.sign != 0)
    varied = len(flowing) >= DRIVE_LEVELS and jumps >= max(4, 0.3 * len(flowing))
    if not (varied or len(flowing) > PULSE_TRAIN):
        return row
    # The rests before and after are not part of what was driven.
    first = next(k for k, level in enumerate(row) if level.sign != 0)
    last = next(k for k in range(len(row) - 1, -1, -1) if row[k].sign != 0)
    drive = replace(record.level(row[first].start, row[last].stop, 1), kind=StepKind.DRIVE)
    return [*row[:first], drive, *row[last + 1 :]]


def _bridge_drives(record: _Record, levels: list[_Level]) -> list[_Level]:
    joined: list[_Level] = []
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
            whole = _span(record, joined[back], level)
            del joined[back:]
            joined.append(whole)
    return joined


def _name(record: _Record, levels: list[_Level]) -> None:
    """Name what has no name yet: rests, pulses, constant-current steps and drifting ones."""
    for level in levels:
        if level.sign == 0 and level.kind is None:
            level.kind = StepKind.REST
    for index, level in enumerate(levels):
        if level.kind is not None:
            continue
        beside = [levels[k] for k in (index - 1, index + 1) if 0 <= k < len(levels)]
        calm = [other.kind in (StepKind.REST, StepKind.PULSE) or _brief(other) for other in beside]
        rests = any(other.kind is StepKind.REST for other in beside)
        if _brief(level) and rests and all(calm):
            level.kind = StepKind.PULSE
        elif _drifts(record, level):
            level.kind = StepKind.DRIVE
        else:
            level.kind = StepKind.CC_CHARGE if level.mean < 0 else StepKind.CC_DISCHARGE


def _brief(level: _Level) -> bool:
    return level.kind is None and level.sign != 0 and level.seconds <= PULSE_S


def _drifts(record: _Record, level: _Level) -> bool:
    low, high = np.quantile(record.current[level.start : level.stop], [0.05, 0.95])
    return bool(high - low > max(0.1 * abs(level.mean), 10.0 * record.noise))


def _numbered(trajectory: Trajectory, levels: list[_Level]) -> tuple[Step, ...]:
    """Steps with their cycles (the rule stands with `segment`)."""
    time, current = trajectory.time, trajectory.current
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (current[1:] + current[:-1]) * np.diff(time))]) / SECONDS_PER_HOUR
    carried = [
        0.0 if level.kind in (StepKind.REST, StepKind.PULSE) else float(passed[level.stop - 1] - passed[level.start])
        for level in levels
    ]
    enough = CYCLE_SHARE * max((abs(charge) for charge in carried), default=0.0)
    steps: list[Step] = []
    cycle, direction, latest = 1, 0.0, 0.0
    for level, charge in zip(levels, carried, strict=True):
        if charge != 0.0 and abs(charge) >= enough:
            way = float(np.sign(charge))
            direction = direction or way
            if way == direction and latest == -direction:
                cycle += 1
            latest = way
        assert level.kind is not None
        steps.append(Step(level.kind, level.start, level.stop, cycle))
    return _merged(steps)


def _merged(steps: list[Step]) -> tuple[Step, ...]:
    """Neighbouring rests are one rest; then each step gets its place in its cycle."""
    merged: list[Step] = []
    for step in steps:
        if merged and step.kind is StepKind.REST and merged[-1].kind is StepKind.REST:
            merged[-1] = replace(merged[-1], stop=step.stop)
            continue
        follows = bool(merged) and merged[-1].cycle == step.cycle
        merged.append(replace(step, position=merged[-1].position + 1 if follows else 0))
    return tuple(merged)
