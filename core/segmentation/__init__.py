"""Cuts a record into the steps a cycler would name, from its current and voltage alone.

The cut goes from fine to coarse, each pass in time proportional to the number of samples:

1. *Signs*: samples are at rest, charging or discharging, with hysteresis so that noise does not flicker.
2. *Levels*: each stretch of one sign is cut wherever the current leaves its running mean.
3. *Holds*: levels that fall one after the other while the voltage stands still are one constant-voltage hold.
4. *Smooth runs*: levels that run into each other without a jump (a drifting current) are joined, and
   a glitch of one or two samples between equal levels is closed.
5. *Drive cycles*: many short levels that follow each other are one drive.
6. *Names*: what is left is a pulse or a constant-current step.
"""

from __future__ import annotations

from dataclasses import replace

from ..trajectory import Trajectory
from .drives import with_drives
from .holds import with_holds
from .levels import levels_of, signals_of, signs_of
from .naming import name_steps, numbered
from .smooth_runs import smoothed, without_edges

__all__ = ["segment"]


def segment(trajectory: Trajectory) -> Trajectory:
    """Cut a record into steps and number its cycles.

    Parameters
    ----------
    trajectory : Trajectory
        Any record; steps that it already has are ignored.

    Returns
    -------
    Trajectory
        The same samples with consecutive steps that cover all of them.

    Notes
    -----
    Current steps at constant power drift and are named `StepKind.DRIVE`, since only their measured current
    describes them. A pulse too short for the sampling, or whose current was not logged (the internal-resistance
    pulse of Arbin cyclers), stays part of its rest.

    A new cycle starts with the first step that carries charge in the direction of the record's first such step
    after one in the opposite direction: a record that begins with a charge counts charges, one that begins
    with a discharge counts discharges. Rests and pulses belong to the cycle that went before, a leading rest to
    cycle 1. Steps that move less than 2 % of the largest step's charge start nothing.
    """
    if len(trajectory) == 0:
        return replace(trajectory, steps=())
    signals = signals_of(trajectory)
    levels = levels_of(signals, signs_of(signals))
    levels = with_holds(signals, levels)
    levels = smoothed(signals, levels)
    levels = without_edges(signals, levels)
    levels = with_drives(signals, levels)
    name_steps(signals, levels)
    return replace(trajectory, steps=numbered(trajectory, levels))
