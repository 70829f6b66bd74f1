"""A measured current as one piecewise linear function, with the instants at which the integrator must stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.trajectory import FloatArray, StepKind, Trajectory
from .drive import _CONSTANT_WITHIN, _smooth_knots

JUMP_S = 1e-3
"""A current step takes this long: short against any sampling, long against rounding of the clock."""


@dataclass(frozen=True)
class MeasuredCurrent:
    """What the cycler drew, in a form that an integrator can follow exactly.

    Attributes
    ----------
    time, current : ndarray of shape (k,)
        Knots in s and A; linear in between, positive on discharge.
    stops : ndarray of shape (m,)
        Where the integrator stops and starts afresh: both ends of every jump. Without them it would step clean
        over a pulse after a long rest.
    finest_s : float or None
        Typical interval between knots where the current varies all the time (drive cycles), s.
    """

    time: FloatArray
    current: FloatArray
    stops: FloatArray
    finest_s: float | None


def measured_current(record: Trajectory) -> MeasuredCurrent:
    """The current of a record that is cut into steps.

    A step reaches to the first sample of the next one: that sample already shows the new current.
    """
    times: list[FloatArray] = []
    currents: list[FloatArray] = []
    stops: list[float] = [float(record.time[0])]
    finest: list[float] = []
    for step in record.steps:
        last = min(step.stop, len(record) - 1)
        time = record.time[step.start : last + 1].copy()
        current = record.current[step.start : last + 1].copy()
        is_final = step.stop > last
        if not is_final and len(current) > 1:
            current[-1] = current[-2]
        start, end = float(time[0]), float(time[-1])
        if end - start < 2.5 * JUMP_S:
            continue
        knots, values = _knots(time, current, step.kind)
        if step.kind is StepKind.DRIVE:
            finest.append(float(np.median(np.diff(knots))))
        inside = (knots > start) & (knots < end - JUMP_S)
        stop_at = end if is_final else end - JUMP_S
        times.append(np.concatenate([[start], knots[inside], [stop_at]]))
        currents.append(np.interp(times[-1], knots, values))
        stops += [start, stop_at]
    stops.append(float(record.time[-1]))
    time, current = np.concatenate(times), np.concatenate(currents)
    # Beyond the record the current stays, so that nothing is ever extrapolated.
    time = np.concatenate([[time[0] - 3600.0], time, [time[-1] + 3600.0]])
    current = np.concatenate([[current[0]], current, [current[-1]]])
    return MeasuredCurrent(time, current, np.unique(stops), min(finest) if finest else None)


def _knots(time: FloatArray, current: FloatArray, kind: StepKind) -> tuple[FloatArray, FloatArray]:
    span = float(time[-1] - time[0])
    mean = float(np.trapezoid(current, time)) / span
    if kind is StepKind.REST:
        mean = 0.0 if abs(mean) < 1e-6 else mean
        return time[[0, -1]], np.array([mean, mean])
    if kind is StepKind.PULSE or len(time) < 3 or np.ptp(current) <= max(_CONSTANT_WITHIN * abs(mean), 1e-6):
        return time[[0, -1]], np.array([mean, mean])
    if kind in (StepKind.CC_CHARGE, StepKind.CC_DISCHARGE) and _only_noise(current):
        return time[[0, -1]], np.array([mean, mean])
    keep = np.concatenate([[True], np.diff(time) > 0])
    time, current = time[keep], current[keep]
    if kind is StepKind.DRIVE:
        return time, current
    return _smooth_knots(time, current)


def _only_noise(current: FloatArray) -> bool:
    """Whether neighbours differ as much as strangers do: a constant current read by a noisy meter."""
    middle = current[1:-1]
    if len(middle) < 8:
        return False
    return float(np.std(np.diff(middle))) > 1.1 * float(np.std(middle))
