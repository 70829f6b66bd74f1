"""Parts of a step under a measured drive, whose mismatches are averaged to one residual each."""

import math
from dataclasses import dataclass

import numpy as np

from ..signals import Signal
from ..trajectory import FloatArray, StepKind
from .alignment import StepPair

_PARTS = 40
"""Parts of a step under a measured drive, where steps are few and long."""

_BY_CHANGE = 0.2
"""Share that the change of the signal has in the length of a part; the rest is its duration. By duration alone the last
part of a discharge at 1C is 90 s long, and in its mean a knee that is 180 mV off one way and 40 mV off the other counts
as 5 mV: a fit of CALCE CS2_35 ended at 26.6 mV rms. With a fifth by change it ends at 4.4, with half and twice as much
at 4.1 and 4.4; with 0.5, by an earlier version, NASA B0005 ended at 10.1 mV in place of 6.0."""

_CURVE = 400
"""Points of a step's curve along which its change is added up: few enough that the noise adds little to it."""

_AVERAGED = 10
"""Points that each part averages at least; where the record has more samples, as many as these: a cell that is empty,
volts off, for the last half minute of a day would fall between fewer."""

OSCILLATING = 200
"""Points at least of a signal that swings within a step: ten for each of twenty periods."""

_OF_A_DRIVE = 400
"""Points of a step whose current varies all the time: ten for each of forty changes of the load."""

_ROUNDING = 1e-9
"""What the sum of the parts' lengths may be off by, in samples."""

_EARLIEST = 1e-4
"""Share of a pulse at which its first part ends at the earliest: four decades lie between this and its end."""


def count_of_parts(kind: str, signal: Signal) -> int:
    """How many parts a step of this kind has."""
    count = _OF_A_DRIVE if kind is StepKind.DRIVE else _PARTS
    return max(count, OSCILLATING) if signal.oscillates else count


@dataclass(frozen=True, eq=False)
class StepParts:
    """The parts of a step, each of which gives one residual of a signal."""

    # Fractions of the step's duration (0 to 1) at which the mismatches stand that each part averages; shape (n, k).
    fractions: FloatArray
    ends: FloatArray  # Fractions at which the parts end; shape (n,).
    weights: FloatArray  # Shares of the step's sum of squares that they have; shape (n,).


def step_parts(pair: StepPair, signal: Signal) -> StepParts:
    """The parts of a step for a signal.

    They are equally long on the curve of the signal, by duration and change together: the knee at the end of a
    discharge is in many parts and a plateau in few. Each counts by its duration, so that the sum of squares is an
    integral over time. In parts of equal duration, errors of either sign within a knee would cancel.
    Those of a pulse are equally long on a logarithmic clock, from its first sample on, and count the same: what is
    ohmic, kinetic or diffusion shows in another decade, and in parts of equal length the last decade would hold nine
    tenths of them. What swings, the signal of an oscillator or of a cell under a drive cycle, would average out: each
    of its parts is one point.
    """
    count = count_of_parts(pair.step.kind, signal)
    pulse = pair.step.kind is StepKind.PULSE
    swings = signal.oscillates or pair.step.kind is StepKind.DRIVE
    if pulse:
        ends = _ends_of_a_pulse(pair, count)
    elif swings or pair.step.kind is StepKind.SPECTRUM:
        ends = _equal(count)
    else:
        ends = _ends_on_the_curve(pair, signal, count)
    starts = np.append(0.0, ends[:-1])
    # As many points in each as the longest one has samples.
    samples = math.ceil(len(pair.measured) * float(np.max(ends - starts)) - _ROUNDING)
    averaged = 1 if swings else max(_AVERAGED, samples)
    # Midpoints: the ends of a step are where two records agree least on the clock.
    inside = (np.arange(averaged) + 0.5) / averaged
    fractions = starts[:, None] + (ends - starts)[:, None] * inside
    return StepParts(fractions, ends, np.full(count, 1.0 / count) if pulse else ends - starts)


def _ends_of_a_pulse(pair: StepPair, count: int) -> FloatArray:
    first = next((fraction for fraction in pair.sampled if fraction > 0.0), 1.0)
    return np.geomspace(np.clip(first, _EARLIEST, 1.0 / count), 1.0, count)


def _equal(count: int) -> FloatArray:
    return np.arange(1, count + 1) / count


def _ends_on_the_curve(pair: StepPair, signal: Signal, count: int) -> FloatArray:
    """Where parts end that are equally long by the duration and the change of a signal together."""
    clock = np.linspace(0.0, 1.0, _CURVE + 1)
    change = np.abs(np.diff(np.interp(clock, pair.sampled, pair.sampled_values(signal))))
    total = float(np.sum(change))
    if total <= 0.0:
        return _equal(count)
    along = np.append(0.0, np.cumsum(_BY_CHANGE * change / total + (1.0 - _BY_CHANGE) / _CURVE))
    ends = np.interp(_equal(count), along / along[-1], clock)
    ends[-1] = 1.0
    return np.asarray(ends)
