"""Parts of a step under a measured drive, whose mismatches are averaged to one residual each."""

import math

import numpy as np

from ..signals import Signal
from ..trajectory import FloatArray, StepKind
from .alignment import StepPair

_PARTS = 40
"""Parts of a step under a measured drive, where steps are few and long."""

_AVERAGED = 10
"""Points that each part averages at least; where the record has more samples, as many as these: a cell that is empty,
volts off, for the last half minute of a day would fall between fewer."""

OSCILLATING = 200
"""Points at least of a signal that swings within a step: ten for each of twenty periods."""

_OF_A_DRIVE = 400
"""Points of a step whose current varies all the time: ten for each of forty changes of the load."""

_EARLIEST = 1e-4
"""Share of a pulse at which its first part ends at the earliest: four decades lie between this and its end."""


def count_of_parts(kind: str, signal: Signal) -> int:
    """How many parts a step of this kind has."""
    count = _OF_A_DRIVE if kind is StepKind.DRIVE else _PARTS
    return max(count, OSCILLATING) if signal.oscillates else count


def step_parts(pair: StepPair, signal: Signal) -> FloatArray:
    """Fractions of a step's duration (0 to 1) at which the mismatches stand that each part averages, a row each.

    The parts of a step are equally long. Those of a pulse are so on a logarithmic clock, from its first sample on: what
    is ohmic, kinetic or diffusion shows in another decade, and in parts of equal length the last decade would hold nine
    tenths of them. What swings, the signal of an oscillator or of a cell under a drive cycle, would average out:
    each of its parts is one point.

    Returns
    -------
    ndarray of shape (n, k)
    """
    count = count_of_parts(pair.step.kind, signal)
    swings = signal.oscillates or pair.step.kind is StepKind.DRIVE
    # Midpoints: the ends of a step are where two records agree least on the clock.
    averaged = 1 if swings else max(_AVERAGED, math.ceil(len(pair.measured) / count))
    inside = (np.arange(averaged) + 0.5) / averaged
    ends = _ends_of_a_pulse(pair, count) if pair.step.kind is StepKind.PULSE else np.arange(1, count + 1) / count
    starts = np.append(0.0, ends[:-1])
    return np.asarray(starts[:, None] + (ends - starts)[:, None] * inside)


def _ends_of_a_pulse(pair: StepPair, count: int) -> FloatArray:
    first = next((fraction for fraction in pair.sampled if fraction > 0.0), 1.0)
    return np.geomspace(np.clip(first, _EARLIEST, 1.0 / count), 1.0, count)
