"""The current of a voltage hold between its samples, and how well its samples tell its charge."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from .trajectory import FloatArray, Step, StepKind, Trajectory

_BETWEEN = 4
"""Parts into which the interval between two samples of a voltage hold is divided."""


def taper_of(record: Trajectory, hold: Step) -> tuple[FloatArray, FloatArray]:
    """Times (s) and current (A) of a hold, from the last sample of the step before it on.

    Cyclers log the first sample of a step up to a sampling interval late. A current that decays from that of the
    charge before the hold had this value when the hold began; any other is constant up to its first sample.
    """
    time, current = record.time[hold.start : hold.stop], record.current[hold.start : hold.stop]
    if hold.start == 0 or time[0] <= record.time[hold.start - 1]:
        return time, current
    before = record.current[hold.start - 1]
    decays = before * current[0] > 0 and abs(before) > abs(current[0])
    return np.append(record.time[hold.start - 1], time), np.append(before if decays else current[0], current)


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
    tapers = [taper_of(record, step) for step in record.steps if step.kind is StepKind.CV_HOLD]
    return abs(sum(_by_every_second(*taper) - _charge(*taper) for taper in tapers))


def _charge(time: FloatArray, current: FloatArray) -> float:
    knots, between = between_samples(time, current)
    return float(np.trapezoid(between, knots))


def _by_every_second(time: FloatArray, current: FloatArray) -> float:
    kept = np.union1d(np.arange(0, len(time), 2), len(time) - 1)
    return _charge(time[kept], current[kept])
