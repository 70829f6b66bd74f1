"""Where a record shows its cell right before and right after the current switches."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..trajectory import Step, StepKind, Trajectory

STEP_SHARE = 0.1
"""A change of current by this share of the largest one shows a resistance."""

_EARLY_V_SHARE, _EARLY_S = 0.3, 10.0
"""A cycler may log the voltage of a switch one sample before its current: the voltage has then taken this share of its
jump, within this time in s. Over a longer one a rest relaxes as far."""


@dataclass(frozen=True)
class Switch:
    """The two samples between which the current of a record goes over from one step to the next."""

    step: Step  # That begins.
    # before, after: Places of the last sample that shows the cell before the switch, and of the first one behind it.
    before: int
    after: int
    early: bool  # Whether the sample between the two has the current of before, and the voltage of after.


def switches(record: Trajectory) -> Iterator[Switch]:
    """The switches of a record in order of time, samples that no instrument took left out."""
    largest = float(np.max(np.abs(record.current), initial=0.0))
    for last, step in pairwise(record.steps):
        places = record.measured_across(step)
        if places is not None:
            before, after = places
            early = before > last.start and _is_early(record, before, after, STEP_SHARE * largest)
            yield Switch(step, before - early, after, early)


def resting_voltage(record: Trajectory) -> float:
    """The open-circuit voltage that a record starts from, as near as it shows, V."""
    first = record.steps[0]
    if first.kind is not StepKind.REST:
        return float(record.voltage[0])
    left = next(switches(record), None)
    return float(record.voltage[first.stop - 1 if left is None else left.before])


def _is_early(record: Trajectory, before: int, after: int, least: float) -> bool:
    time, current, voltage = record.time, record.current, record.voltage
    change = float(current[after] - current[before])
    still = abs(current[before] - current[before - 1]) < 0.05 * abs(change)
    prompt = time[before] - time[before - 1] <= _EARLY_S
    moved, jump = float(voltage[before] - voltage[before - 1]), float(voltage[after] - voltage[before - 1])
    with_the_load = moved * change < 0.0
    taken = not record.inserted[before - 1]
    return bool(
        abs(change) >= least
        and still
        and prompt
        and taken
        and with_the_load
        and abs(moved) > _EARLY_V_SHARE * abs(jump)
    )
