"""The current of a voltage hold between its samples, and how well its samples tell its charge."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from .trajectory import FloatArray, Step, StepKind, Trajectory

_BETWEEN = 4
"""Parts into which the interval between two samples of a voltage hold is divided."""


def from_its_beginning(record: Trajectory, step: Step) -> tuple[FloatArray, FloatArray]:
    """Times (s) and current (A) of a step, from the last sample of the step before it on.

    Cyclers log the first sample of a step up to a sampling interval late (a minute late, in some records). The current
    of a voltage hold that decays from that of the charge before it had this value when the hold began; any other is
    constant up to its first sample.
    """
    time, current = record.time[step.start : step.stop], record.current[step.start : step.stop]
    if step.start == 0 or time[0] <= record.time[step.start - 1]:
        return time, current
    before = record.current[step.start - 1]
    decays = step.kind is StepKind.CV_HOLD and before * current[0] > 0 and abs(before) > abs(current[0])
    return np.append(record.time[step.start - 1], time), np.append(before if decays else current[0], current)


def at_distinct_times(time: FloatArray, current: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The samples without those that have the time of the one before."""
    keep = np.concatenate([[True], np.diff(time) > 0])
    return time[keep], current[keep]


def between_samples(time: FloatArray, current: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A hold's current with knots between its samples, where it decays much as an exponential does.

    Straight lines between samples a minute apart overstate the charge of a hold by a few thousandths, always in one
    direction: after twenty cycles the cell would be half a percent fuller than it was.
    """
    share = np.arange(_BETWEEN) / _BETWEEN
    knots = np.append((time[:-1, None] + np.diff(time)[:, None] * share).ravel(), time[-1])
    if np.any(current * current[0] <= 0):
        return knots, np.interp(knots, time, current)
    decay = PchipInterpolator(time, np.log(np.abs(current)))
    return knots, np.sign(current[0]) * np.exp(decay(knots))


def hidden_charge(record: Trajectory) -> float:
    """Charge (A.s) that the samples of a record's voltage holds leave unknown, all holds together.

    It is the difference between the charge by all samples and by every second one. Of 33 simulated holds (four
    parameter sets, SPMe and DFN, sampled every 10 to 180 s) the charge by all samples was off by less than this
    in 31, and by 0.42 of it in the median.
    """
    holds = [step for step in record.steps if step.kind is StepKind.CV_HOLD]
    tapers = [at_distinct_times(*from_its_beginning(record, hold)) for hold in holds]
    # Of two samples every second one is both.
    return abs(sum(_by_every_second(*taper) - _charge(*taper) for taper in tapers if len(taper[0]) > 2))


def _charge(time: FloatArray, current: FloatArray) -> float:
    knots, between = between_samples(time, current)
    return float(np.trapezoid(between, knots))


def _by_every_second(time: FloatArray, current: FloatArray) -> float:
    kept = np.union1d(np.arange(0, len(time), 2), len(time) - 1)
    return _charge(time[kept], current[kept])
