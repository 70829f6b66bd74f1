"""Levels: stretches of one sign and nearly one current, which the later passes join and name."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..trajectory import FloatArray, StepKind, Trajectory

Signs = NDArray[np.int8]

REST_SHARE = 0.005
"""A current below this share of the largest one is a rest, unless noise asks for more."""

REST_SHARE_NOISY = 0.025
"""The largest share of the current that noise may turn into a rest."""

LEVEL_SHARE = 0.015
"""A current this share away from the running mean starts a new level."""

NOISE_SHARE = 0.008
"""Scatter above this share of the largest current is taken for signal, not noise."""

ANSWERED = 0.3
"""Correlation of changes of the current with falls of the voltage from which a cell answers them; see `answer`."""

LONG_S = 120.0
"""A level is a step of its own when it lasts this long and holds at least `LONG_SAMPLES`, in s."""

LONG_SAMPLES = 4

BRIEF_S = 60.0
"""A constant current that lasts no longer than this beside a rest is a pulse, and a falling one no hold, in s."""


@dataclass(slots=True)
class Level:
    """Samples ``start`` to ``stop - 1`` of one sign, at one mean current."""

    start: int
    stop: int
    sign: int  # -1 (charge), 0 (rest) or 1 (discharge).
    mean: float  # Mean current, A.
    seconds: float  # Duration; see `RecordSignals.seconds`.
    kind: StepKind | None = None  # None until it is named.

    @property
    def samples(self) -> int:
        """How many samples."""
        return self.stop - self.start

    @property
    def long(self) -> bool:
        """Whether it is a step of its own."""
        return self.seconds >= LONG_S and self.samples >= LONG_SAMPLES


@dataclass(frozen=True)
class RecordSignals:
    """The samples of a record, each array of shape (n,), with the scales that every pass of the segmentation uses."""

    time: FloatArray  # s
    current: FloatArray  # A, positive on discharge
    voltage: FloatArray  # V
    scale: float  # Largest current, A; infinite for a record that is one long rest.
    noise: float  # Standard deviation of the current's noise, A.
    voltage_noise: float  # Standard deviation of the voltage's noise, V.

    def tolerance(self, mean: float) -> float:
        """How far a sample may lie from the mean of its level, in A."""
        return max(LEVEL_SHARE * abs(mean), 5.0 * self.noise)

    def seconds(self, start: int, stop: int) -> float:
        """Duration of samples ``start`` to ``stop - 1``, s.

        The last one lasts until the next sample, but no longer than the others on average: a gap adds nothing.
        """
        inside = float(self.time[stop - 1] - self.time[start])
        if stop >= len(self.time):
            return inside
        after = float(self.time[stop] - self.time[stop - 1])
        return inside + (min(after, inside / (stop - start - 1)) if stop - start >= 3 else after)

    def level(self, start: int, stop: int, sign: int) -> Level:
        """Samples ``start`` to ``stop - 1`` as one level."""
        mean = float(np.mean(self.current[start:stop]))
        return Level(start, stop, sign, mean, self.seconds(start, stop))


def signals_of(trajectory: Trajectory) -> RecordSignals:
    """A record's samples, with its largest current and its noise."""
    current, voltage = trajectory.current, trajectory.voltage
    scale = float(np.max(np.abs(current)))
    # One wild sample in a thousand must not set the scale, but short pulses must.
    if len(current) >= 1000:
        scale = min(scale, 3.0 * float(np.quantile(np.abs(current), 0.999)) or scale)
    everywhere = _scatter(current)
    if scale == 0.0 or (scale < 6.0 * everywhere and not _moves_voltage(current, voltage)):
        # Nothing, or noise around zero: one long rest.
        return RecordSignals(trajectory.time, current, voltage, np.inf, 0.0, _scatter(voltage))
    flowing = current[np.abs(current) > max(REST_SHARE * scale, 4.0 * min(everywhere, NOISE_SHARE * scale))]
    noise = min(max(everywhere, _scatter(flowing)), NOISE_SHARE * scale)
    return RecordSignals(trajectory.time, current, voltage, scale, noise, _scatter(voltage))


def _scatter(values: FloatArray) -> float:
    """Standard deviation of the noise on a slowly varying signal; its steps and drives do not count."""
    if len(values) < 3:
        return 0.0
    # The lower quartile of |difference| of Gaussian noise is 0.3186 sqrt(2) of its standard deviation.
    return float(np.quantile(np.abs(np.diff(values)), 0.25) / (0.3186 * np.sqrt(2.0)))


def _moves_voltage(current: FloatArray, voltage: FloatArray) -> bool:
    """Whether changes of the current show in the voltage, as they do in a drive but not in noise."""
    if len(current) < 3:
        return True
    # A steady current has noise of either sign, but its mean stands clear of zero.
    steady = abs(float(np.mean(current))) > 3.0 * float(np.std(current))
    return steady or answer(np.diff(current), np.diff(voltage)) > ANSWERED


def answer(changes: FloatArray, moves: FloatArray) -> float:
    """Correlation of changes of the current, A, with falls of the voltage, V: 1 behind a resistance, 0 in noise."""
    size = float(np.sqrt(np.sum(changes**2) * np.sum(moves**2)))
    return float(-np.sum(changes * moves)) / size if size > 0.0 else 0.0


def signs_of(signals: RecordSignals) -> Signs:
    """-1 (charge), 0 (rest) or 1 (discharge) for each sample."""
    share = np.clip(5.0 * signals.noise / signals.scale, REST_SHARE, REST_SHARE_NOISY)
    high = share * signals.scale if np.isfinite(signals.scale) else np.inf
    low = 0.5 * high
    size = np.abs(signals.current)
    flowing = np.where(size > 0.0, np.sign(signals.current), 0.0).astype(np.int8)
    signs = np.where(size < high, np.int8(0), flowing)
    # Between the two thresholds a sample keeps the state of the sample before it, if the sign agrees and the
    # current did not fall there in one go.
    unsure = (size >= low) & (size < high) & (size >= 0.5 * np.concatenate([[np.inf], size[:-1]]))
    known = np.where(unsure, 0, np.arange(len(size)))
    last_known = np.maximum.accumulate(known)
    kept = signs[last_known]
    return _without_specks(np.where(unsure & (kept == flowing), kept, signs), size, 2.5 * high)


def _without_specks(signs: Signs, size: FloatArray, enough: float) -> Signs:
    """Turn one or two samples of a small current within a rest into rest: noise has rare large values."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(signs)) + 1, [len(signs)]])
    for k in np.flatnonzero((np.diff(edges) <= 2) & (signs[edges[:-1]] != 0)):
        start, stop = edges[k], edges[k + 1]
        alone = (start == 0 or signs[start - 1] == 0) and (stop == len(signs) or signs[stop] == 0)
        if alone and size[start:stop].max() < enough:
            signs[start:stop] = 0
    return signs


def levels_of(signals: RecordSignals, signs: Signs, cuts: NDArray[np.intp]) -> list[Level]:
    """Stretches of one sign, cut at the given samples and wherever the current leaves its running mean."""
    edges = [0, *np.union1d(np.flatnonzero(np.diff(signs)) + 1, cuts).tolist(), len(signs)]
    currents = signals.current.tolist()
    levels: list[Level] = []
    floor = 5.0 * signals.noise
    for first, last in pairwise(edges):
        sign = int(signs[first])
        if sign == 0:
            levels.append(signals.level(first, last, 0))
            continue
        start, mean = first, currents[first]
        for k in range(first + 1, last):
            value = currents[k]
            if abs(value - mean) > max(LEVEL_SHARE * abs(mean), floor):
                levels.append(Level(start, k, sign, mean, signals.seconds(start, k)))
                start, mean = k, value
            else:
                mean += (value - mean) / (k - start + 1)
        levels.append(Level(start, last, sign, mean, signals.seconds(start, last)))
    return levels


def span(signals: RecordSignals, first: Level, last: Level) -> Level:
    """One level from the first to the last, whose mean is that of these two: a long row of levels costs no more."""
    weight = first.samples + last.samples
    mean = (first.mean * first.samples + last.mean * last.samples) / weight
    return Level(first.start, last.stop, first.sign, mean, signals.seconds(first.start, last.stop), first.kind)
