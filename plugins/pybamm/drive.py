"""Protocols and measured currents as PyBaMM experiments."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.errors import BsaError
from ...core.task import Experiment
from ...core.trajectory import StepKind, Trajectory
from .parameter_sets import pybamm

_CONSTANT_WITHIN = 2e-3
"""A step whose current stays this close to its mean (relative) is driven by the mean, which keeps the charge."""

_KNOTS = 50
"""Knots that stand for a smoothly varying current, as during a voltage hold."""

_LOWEST_CUT_OFF_V, _HIGHEST_CUT_OFF_V = 0.5, 6.0


def steps_of(experiment: Experiment) -> list[list[Any]]:
    """The experiment as cycles of PyBaMM steps.

    Raises
    ------
    BsaError
        If a protocol string is not one that PyBaMM understands.
    """
    if experiment.protocol is not None:
        return [[_parse(text) for text in cycle] for cycle in experiment.protocol]
    return [_measured_steps(experiment.target)]


def _parse(text: str) -> Any:
    try:
        return pybamm.step.string(text)
    except (ValueError, TypeError, KeyError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BsaError(
            f'PyBaMM cannot read the step "{text}": {reason}',
            'write for example "Discharge at 1C until 2.5 V" or "Rest for 1 hour".',
        ) from None


def widen_cut_offs(values: Any) -> None:
    """Let a measured current run its course: a voltage event would end it before the record does."""
    values.update({"Lower voltage cut-off [V]": _LOWEST_CUT_OFF_V, "Upper voltage cut-off [V]": _HIGHEST_CUT_OFF_V})


def _measured_steps(record: Trajectory) -> list[Any]:
    """One PyBaMM step for each step of the record.

    The integrator restarts at each: as one bare interpolant over the whole record it would step clean
    over a short pulse that follows a long rest. A step begins where the one before it logged its last
    sample: cyclers log a sample when a step ends, and the first one of the next step up to a sampling
    interval late (a minute late, in some records).
    """
    result: list[Any] = []
    begin = float(record.time[0])
    for step in record.steps:
        time, current = record.time[step.start : step.stop], record.current[step.start : step.stop]
        if time[0] > begin:
            time, current = np.append(begin, time), np.append(current[0], current)
        if time[-1] > begin:
            result.append(_constant_or_drive(time - begin, current, step.kind))
        begin = float(time[-1])
    return result


def _constant_or_drive(time: np.ndarray, current: np.ndarray, kind: StepKind) -> Any:
    duration = float(time[-1])
    mean = float(np.trapezoid(current, time) / duration)
    if kind is StepKind.REST:
        return pybamm.step.Current(0.0 if abs(mean) < 1e-6 else mean, duration=duration)
    if np.ptp(current) <= max(_CONSTANT_WITHIN * abs(mean), 1e-6) or len(time) < 3:
        return pybamm.step.Current(mean, duration=duration)
    keep = np.concatenate([[True], np.diff(time) > 0])
    time, current = time[keep], current[keep]
    if kind is not StepKind.DRIVE:
        time, current = _smooth_knots(time, current)
    # One more knot beyond the end, so that the integrator never extrapolates.
    time, current = np.append(time, duration + 60.0), np.append(current, current[-1])
    words = f"Measured current of {current[0]:.3g} to {current[-1]:.3g} A for {duration:.0f} s"
    return pybamm.step.Current(np.column_stack([time, current]), duration=duration, description=words)


def _smooth_knots(time: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A decaying current by few knots, dense where it bends, with the charge kept.

    Every knot of the interpolant is a kink that costs the integrator a few steps: a tail of 700 samples
    takes five times as long as one of 50 knots, and says no more.
    """
    if len(time) <= _KNOTS:
        return time, current
    progress = np.abs(np.gradient(current)) / max(np.ptp(current), 1e-12) + np.gradient(time) / time[-1]
    place = np.concatenate([[0.0], np.cumsum(0.5 * (progress[1:] + progress[:-1]))])
    picks = np.unique(np.searchsorted(place, np.linspace(0.0, place[-1], _KNOTS)).clip(0, len(time) - 1))
    knots, values = time[picks], current[picks]
    charge, kept = np.trapezoid(current, time), np.trapezoid(values, knots)
    return knots, values * (charge / kept if kept else 1.0)
