"""Where a record shows its cell right before and right after the current switches."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..printable import counted, rounded
from ..record import Record
from ..trajectory import Step, StepKind, Trajectory

STEP_SHARE = 0.1
"""A change of current by this share of the largest one shows a resistance."""

_EARLY_V_SHARE, _LATE_V_SHARE, _PROMPT_S = 0.3, 0.1, 10.0
"""A cycler may log the voltage of a switch one sample before its current, or one sample after it: the voltage has then
taken more than the first share of its jump already, or less than the second, within this time in s. Over a longer one a
rest relaxes as far. At once a cell takes a third of its jump or more (its ohmic resistance over that after 10 s)."""

_UNDER_LOAD = 0.05
"""Share of a record's largest current above which its first sample is no open-circuit voltage: with less it is off by
as small a share of the polarisation."""


@dataclass(frozen=True)
class Switch:
    """The two samples between which the current of a record goes over from one step to the next."""

    step: Step  # That begins.
    # before, after: Places of the last sample that shows the cell before the switch, and of the first one behind it.
    before: int
    after: int
    # Place of a sample between the two whose current is that of one side of the switch and whose voltage of the other.
    mixed: int | None


def switches(record: Trajectory) -> Iterator[Switch]:
    """The switches of a record in order of time, samples that no instrument took left out."""
    largest = float(np.max(np.abs(record.current), initial=0.0))
    for last, step in pairwise(record.steps):
        places = record.measured_across(step)
        if places is not None:
            before, after = places
            large = abs(record.current[after] - record.current[before]) >= STEP_SHARE * largest
            if large and before > last.start and _is_early(record, before, after):
                yield Switch(step, before - 1, after, mixed=before)
            elif large and after + 1 < step.stop and _is_late(record, before, after):
                yield Switch(step, before, after + 1, mixed=after)
            else:
                yield Switch(step, before, after, mixed=None)


def begins_under_load(record: Trajectory) -> bool:
    """Whether a cell's first sample shows it under load, so that its voltage is no open-circuit voltage."""
    current = np.abs(record.current)
    return bool(current[0] > _UNDER_LOAD * np.max(current))


def resting_voltage(record: Trajectory) -> float:
    """The open-circuit voltage that a record starts from, as near as it shows, V."""
    first = record.steps[0]
    if first.kind is not StepKind.REST:
        return float(record.voltage[0])
    left = next(switches(record), None)
    return float(record.voltage[first.stop - 1 if left is None else left.before])


def mixed_samples_note(record: Trajectory) -> str:
    """What is to be said of samples whose current is that of one side of a switch and whose voltage of the other."""
    mixed = _mixed(record)
    if not mixed:
        return ""
    return (
        "current and voltage of a sample are not of one moment where the current switches "
        f"({counted(len(mixed), 'sample')}, the first at {rounded(float(record.time[mixed[0]]), 6)} s): what the cell "
        "shows is read one sample further from the switch, and a fit leaves such samples out (--voltage-lag 0 keeps "
        "them)."
    )


def without_mixed_samples(record: Record) -> Record:
    """The record with such samples marked as if no instrument had taken them, and a note of it."""
    found = record.trajectory
    note = mixed_samples_note(found)
    if not note:
        return record
    inserted = found.inserted.copy()
    inserted[_mixed(found)] = True
    return replace(record, trajectory=replace(found, inserted=inserted), notes=(*record.notes, note))


def _mixed(record: Trajectory) -> list[int]:
    return [switch.mixed for switch in switches(record) if switch.mixed is not None]


def _is_early(record: Trajectory, before: int, after: int) -> bool:
    """Whether the last sample before a switch has the voltage of behind it."""
    moved, jump = record.voltage[[before, after]] - record.voltage[before - 1]
    steps = _steps_alone(record, before - 1, float(record.current[after] - record.current[before]))
    return steps and bool(abs(moved) > _EARLY_V_SHARE * abs(jump))


def _is_late(record: Trajectory, before: int, after: int) -> bool:
    """Whether the first sample behind a switch has the voltage of before it."""
    moved, jump = record.voltage[[after, after + 1]] - record.voltage[before]
    steps = _steps_alone(record, after, float(record.current[after] - record.current[before]))
    return steps and bool(abs(moved) < _LATE_V_SHARE * abs(jump))


def _steps_alone(record: Trajectory, place: int, change: float) -> bool:
    """Whether the voltage moves as this change of the current has it move, between two samples of one current."""
    pair = [place, place + 1]
    interval, current, voltage = (float(np.diff(v[pair])[0]) for v in (record.time, record.current, record.voltage))
    taken = not np.any(record.inserted[pair])
    return taken and interval <= _PROMPT_S and abs(current) < 0.05 * abs(change) and voltage * change < 0.0
