"""How noisy a recorded signal is, from the record alone."""

import math

import numpy as np

from ..normal import robust_deviation
from ..trajectory import FloatArray, StepKind, Trajectory

_FEWEST = 30
"""Differences without which nothing is said of the noise."""

_SETTLING = 4
"""First samples of a step, which bend too much."""

_REPEATING = 0.9
"""Share of distinct readings above which a signal shows no rounding."""

_NO_ROUNDING = 1e-6
"""Noise that is always there, in the signal's unit."""

_FREEDOM_OF_DIFFERENCE = 0.25
"""Degrees of freedom that a second difference adds to the noise: of three that share samples two are nearly told by the
others, and the median of sizes uses half of what is left."""

_GOLDEN = 0.6180339887498949
"""Multiples of this fill the unit interval evenly after the decimal point."""


def noise_of(record: Trajectory, signal: FloatArray, order: int = 2) -> float | None:
    """Standard deviation of a signal's measurement noise, in the signal's unit; None where too few samples tell it.

    Repeated differences of evenly spaced neighbours remove any smooth curve; their median absolute deviation is
    not affected by the few that straddle an event. For white noise of deviation s a difference of order k has the
    deviation ``s sqrt(binomial(2k, k))``. Never below what the resolution of the instrument leaves (a step of q gives
    ``q / sqrt(12)``). Higher orders see less of the curve where samples are far apart.

    Drive cycles are left out, also where nothing else is there: their voltage is rough by itself. Of the Panasonic
    18650PF the US06 cycle would tell 0.4 mV, ten times the noise that pulses and rests of the same cycler show.
    """
    differences = _differences_of(record, signal, order)
    if len(differences) < _FEWEST:
        return None
    rounding = resolution(signal)
    # Rounded readings have differences of whole steps, whose median would be a whole step too, and often none.
    even = math.sqrt(12.0) * rounding * (np.arange(len(differences)) * _GOLDEN % 1.0 - 0.5)
    scatter = robust_deviation(differences + even) / math.sqrt(math.comb(2 * order, order))
    return max(scatter, rounding)


def noise_freedom(record: Trajectory) -> float:
    """Degrees of freedom of a noise that second differences tell (`noise_of`); infinite where they are too few to."""
    count = len(_differences_of(record, record.voltage, 2))
    return _FREEDOM_OF_DIFFERENCE * count if count >= _FEWEST else math.inf


def _differences_of(record: Trajectory, signal: FloatArray, order: int) -> FloatArray:
    """Differences of a signal within the steps of a record that are no drive cycles."""
    pieces = [
        _differences(record.time[step.start : step.stop], signal[step.start : step.stop], order)
        for step in record.steps
        if step.kind is not StepKind.DRIVE
    ]
    return np.concatenate(pieces) if pieces else np.zeros(0)


def _differences(time: FloatArray, signal: FloatArray, order: int) -> FloatArray:
    time, signal = time[_SETTLING:], signal[_SETTLING:]
    if len(time) <= order + 2:
        return np.zeros(0)
    gaps = np.diff(time)
    even = np.abs(np.diff(gaps)) < 0.05 * np.maximum(gaps[1:], 1e-9)
    # A difference of order k spans k gaps, which must all be alike.
    alike = np.lib.stride_tricks.sliding_window_view(even, order - 1).all(axis=1)
    return np.asarray(np.diff(signal, order)[alike])


def resolution(signal: FloatArray) -> float:
    """What rounding contributes: the smallest step between distinct readings over sqrt(12); 1e-6 where none repeats."""
    distinct = np.unique(signal)
    if not 2 <= len(distinct) < _REPEATING * len(signal):
        return _NO_ROUNDING
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 0.1 * _NO_ROUNDING]  # what differs by less is one reading, written in two ways
    return max(float(np.min(gaps)) / math.sqrt(12.0), _NO_ROUNDING) if len(gaps) else _NO_ROUNDING


def rounding_that_stays(noise: float, rounding: float) -> float:
    """Deviation of the part of rounding errors that neighbouring readings share, in the unit of its arguments.

    With noise of half a rounding step or more, the rounding errors of neighbours are practically independent. Without
    noise, neighbours with the same reading have the same error, and so has their mean. ``noise`` is the standard
    deviation of a reading, rounding included; ``rounding`` is what that contributes (`resolution`).

    References
    ----------
    Widrow & Kollar, Quantization Noise (2008), Ch. 4 and 5: the Fourier series of the mean error.
    """
    order = np.arange(1.0, 30.0)
    apart = max((noise / rounding) ** 2 - 1.0, 0.0)
    shares = 6.0 / (np.pi * order) ** 2 * np.exp(-((np.pi * order) ** 2) * apart / 3.0)
    return rounding * math.sqrt(float(np.sum(shares)))
