"""How noisy a record's voltage is, from the record alone."""

from __future__ import annotations

import numpy as np

from ..trajectory import FloatArray, StepKind, Trajectory

_FEWEST = 30
_FALLBACK_V = 1e-3


def voltage_noise(record: Trajectory) -> float:
    """Standard deviation of the measurement noise, V.

    Second differences of evenly spaced neighbours remove any smooth curve; their median absolute deviation is
    blind to the few that straddle an event. For white noise of deviation s a second difference has the
    deviation s sqrt(6). Never below what the resolution of the instrument leaves (a step of q gives q / sqrt(12)).

    Notes
    -----
    Drive cycles are left out while anything else is there: their voltage is rough by itself.
    """
    pieces = [_second_differences(part) for step, part in record.pieces() if step.kind is not StepKind.DRIVE]
    differences = np.concatenate(pieces) if pieces else np.zeros(0)
    if len(differences) < _FEWEST:
        return max(_FALLBACK_V, _resolution(record.voltage))
    scatter = 1.4826 * float(np.median(np.abs(differences))) / np.sqrt(6.0)
    return float(max(scatter, _resolution(record.voltage)))


def _second_differences(part: Trajectory) -> FloatArray:
    # The first samples of a step bend too much.
    time, voltage = part.time[4:], part.voltage[4:]
    if len(time) < 5:
        return np.zeros(0)
    gaps = np.diff(time)
    even = np.abs(gaps[1:] - gaps[:-1]) < 0.05 * np.maximum(gaps[1:], 1e-9)
    return np.diff(voltage, 2)[even]


def _resolution(voltage: FloatArray) -> float:
    """What rounding contributes: the smallest step between distinct readings over sqrt(12), V."""
    distinct = np.unique(voltage)
    if len(distinct) < 2:
        return 1e-6
    gaps = np.diff(distinct)
    step = float(np.min(gaps[gaps > 1e-7])) if np.any(gaps > 1e-7) else 1e-7
    # Without rounding the smallest gap among n readings is tiny and so is this.
    return float(step / np.sqrt(12.0))
