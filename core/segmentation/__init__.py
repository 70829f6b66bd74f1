"""Cuts a record into the steps a cycler would name, from its current and voltage, and from its step numbers if any.

The cut goes from fine to coarse, each pass in time proportional to the number of samples:

1. *Signs*: samples are at rest, charging or discharging, with hysteresis so that noise does not flicker.
2. *Levels*: each stretch of one sign is cut wherever the current leaves its running mean.
3. *Wobbles*: levels of one sign whose changes of the current the voltage does not answer are one level.
4. *Holds*: levels that fall one after the other while the voltage stands still are one constant-voltage hold.
5. *Smooth runs*: levels that run into each other without a jump (a drifting current) are joined, a glitch of one or
   two samples between equal levels is closed, and a ramp of the current belongs to the step that it leads to.
6. *Drive cycles*: many short levels that follow each other are one drive.
7. *Names*: what is left is a pulse or a constant-current step.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..trajectory import FloatArray, Trajectory
from .drives import with_drives
from .holds import with_holds
from .levels import Level, Signs, levels_of, signals_of, signs_of
from .naming import name_steps, numbered
from .smooth_runs import smoothed, without_edges, without_ramps
from .wobbles import without_wobbles

__all__ = ["segment"]

FEWEST_SAMPLES = 4
"""Half of the steps of a file have at least so many samples, or they are the points of a drive cycle."""


def segment(
    trajectory: Trajectory,
    steps: FloatArray | None = None,
    cycles: FloatArray | None = None,
    tests: FloatArray | None = None,
) -> Trajectory:
    """Cut a record into steps and number its cycles.

    Parameters
    ----------
    trajectory : Trajectory
        Any record; steps that it already has are ignored.
    steps : ndarray of shape (n,), optional
        The cycler's number of each sample's step: a step ends wherever it changes, and may be cut further, since one
        step of a cycler can be a charge at constant current and then at constant voltage. NaN is as the sample before.
    cycles : ndarray of shape (n,), optional
        The cycler's number of each sample's cycle; used where it rises, and never falls.
    tests : ndarray of shape (n,), optional
        The number of each sample's test, where several were joined: no step goes on from one test into the next.

    Returns
    -------
    Trajectory
        The same samples with consecutive steps that cover all of them.

    Notes
    -----
    Current steps at constant power drift and are named `StepKind.DRIVE`, since only their measured current
    describes them. A pulse too short for the sampling, or whose current was not logged (the internal-resistance
    pulse of Arbin cyclers), stays part of its rest.

    Without ``cycles``, a new cycle starts with the first step that carries charge in the direction of the record's
    first such step after one in the opposite direction: a record that begins with a charge counts charges, one that
    begins with a discharge counts discharges. Rests and pulses belong to the cycle that went before, a leading rest to
    cycle 1. Steps that move less than 2 % of the largest step's charge start nothing.
    """
    if len(trajectory) == 0:
        return replace(trajectory, steps=())
    signals = signals_of(trajectory)
    signs = signs_of(signals)
    numbers = _cycle_numbers(cycles, signs)
    begun = np.flatnonzero(np.diff(tests) != 0) + 1 if tests is not None else np.zeros(0, dtype=np.intp)
    cuts = np.union1d(_cuts(steps, numbers), begun)
    levels: list[Level] = []
    for stretch in _stretches(levels_of(signals, signs, cuts), cuts):
        stretch = with_holds(signals, without_wobbles(signals, stretch), levels[-1] if levels else None)
        levels += without_edges(signals, without_ramps(signals, smoothed(signals, stretch)))
    levels = with_drives(signals, levels)
    name_steps(signals, levels)
    return replace(trajectory, steps=numbered(trajectory, levels, numbers, set(begun.tolist())))


def _cycle_numbers(cycles: FloatArray | None, signs: Signs) -> NDArray[np.int64] | None:
    """From 1, where current first flows; None where the numbers do not count the cycles of the whole record."""
    if cycles is None or not np.all(np.isfinite(cycles)) or np.any(np.diff(cycles) < 0) or not signs.any():
        return None
    numbers = np.maximum(cycles - cycles[np.argmax(signs != 0)], 0.0).astype(np.int64) + 1
    return numbers if numbers[-1] > 1 else None


def _cuts(steps: FloatArray | None, cycles: NDArray[np.int64] | None) -> NDArray[np.intp]:
    """The first sample of each of the cycler's steps but the first."""
    cut = np.zeros(0, dtype=np.intp)
    if steps is not None:
        last_known = np.maximum.accumulate(np.where(np.isfinite(steps), np.arange(len(steps)), 0))
        changes = np.flatnonzero(np.abs(np.diff(steps[last_known])) > 0) + 1
        if len(changes) and np.median(np.diff([0, *changes, len(steps)])) >= FEWEST_SAMPLES:
            cut = changes
    return cut if cycles is None else np.union1d(cut, np.flatnonzero(np.diff(cycles)) + 1)


def _stretches(levels: list[Level], cuts: NDArray[np.intp]) -> Iterator[list[Level]]:
    """The levels of each of the cycler's steps; no level spans a cut."""
    ends = set(cuts.tolist())
    stretch: list[Level] = []
    for level in levels:
        if level.start in ends and stretch:
            yield stretch
            stretch = []
        stretch.append(level)
    yield stretch
