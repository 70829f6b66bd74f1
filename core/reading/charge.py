"""Says where the charge of a record is uncertain: in gaps, between samples, and over many cycles."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..printable import counted, rounded
from ..trajectory import SECONDS_PER_HOUR, FloatArray, StepKind, Trajectory
from .counters import LATE_S, counted_between
from .gaps import gaps_in
from .samples import Samples
from .switches import resting_voltage

NOTED_SHARE = 0.005
"""Charge that is uncertain by less than this share of the record's range goes unsaid."""

FULL_V = 0.02
"""A charge that ends this near the record's upper voltage is a full one, in V."""

SAME_REST_V, NOT_BACK_SHARE = 0.03, 0.05
"""Two rest voltages as near as this, in V, belong to states of charge within some percent of each other; a net charge
beyond this share of the record's range then has another cause."""

_TOLD = 0.5
"""Share of a net charge that may lie between the two rest voltages: with more of it hardly anything is told of the
rest."""

DRIFT_CYCLES = 4
"""From so many cycles on, a net charge that drifts is told from a first cycle that began half full."""

DRIFT_SHARE = 0.002
"""A cell loses less than this share of its capacity a cycle; a larger drift of the net charge is the instrument's."""


@dataclass(frozen=True, eq=False)
class CountedCharge:
    """What a file's own counter says beside the current of its n samples."""

    passed: FloatArray  # Charge drawn between neighbouring samples by the counter, A.h. Shape (n - 1,).
    missed: FloatArray  # How much of it the samples do not show, A.h; 0 where nothing is known. Shape (n - 1,).
    # silent, late: The samples after which much is missed: in a long silence, and between others far apart.
    silent: NDArray[np.intp]
    late: NDArray[np.intp]


@dataclass(frozen=True)
class UnreturnedCharge:
    """Charge that a record does not bring back although it ends near the rest voltage where it began."""

    # began_v, ended_v: Rest voltages, V.
    began_v: float
    ended_v: float
    net_ah: float  # Drawn less charged, A.h.
    range_ah: float  # Between the emptiest and the fullest moment, A.h.
    between_ah: float  # Drawn between the two rest voltages, as far as the record shows it, A.h.
    hours: float  # How long a current passed.

    @property
    def offset_a(self) -> float:
        """What the instrument would have to add to every current, A, positive on discharge."""
        return (self.net_ah - self.between_ah) / self.hours


def counted_charge(samples: Samples, trajectory: Trajectory) -> CountedCharge | None:
    """What the counter of the checked samples says; None without one. The same samples come cut into steps."""
    passed = counted_between(samples)
    if passed is None:
        return None
    drawn = trajectory.discharge_capacity
    size = min(float(np.ptp(drawn)), float(np.ptp(np.nancumsum(passed))) or np.inf)
    missed = passed - np.diff(drawn)
    missed[~np.isfinite(missed)] = 0.0  # without a counter nothing is known
    if samples.sheet is not None:
        missed[np.diff(samples.sheet) != 0] = 0.0  # each file's counters begin anew
    large = np.flatnonzero(np.abs(missed) > NOTED_SHARE * size)
    gaps = gaps_in(samples)
    late = np.setdiff1d(large, gaps)
    return CountedCharge(passed, missed, np.intersect1d(large, gaps), late[np.diff(samples.time)[late] > LATE_S])


def charge_notes(samples: Samples, trajectory: Trajectory, found: CountedCharge | None) -> list[str]:
    """What a user should know about the charge of a record.

    The checked samples, current positive on discharge, come with the same cut into steps, and with their
    `counted_charge`.
    """
    notes = [] if found is None else _of_counter(samples, found)
    return notes + _of_offset(trajectory) + _of_drift(trajectory)


def _of_counter(samples: Samples, found: CountedCharge) -> list[str]:
    passed, missed, silent, late = found.passed, found.missed, found.silent, found.late
    notes = []
    if len(silent):
        k = int(silent[np.argmax(np.abs(passed[silent]))])
        notes.append(
            f"charge passed in {counted(len(silent), 'gap')}, by the file's own counter: "
            f"{np.sum(passed[silent]):+.3g} A.h drawn in all, most ({passed[k]:+.3g} A.h) after {samples.place(k)}."
        )
    if len(late):
        k = int(late[np.argmax(np.abs(missed[late]))])
        took_s = rounded(samples.time[k + 1] - samples.time[k], 3)
        notes.append(
            f"the current switches between samples far apart in {counted(len(late), 'place')}, so it adds up to "
            f"another charge than the file's own counter: {np.sum(missed[late]):+.3g} A.h in all, most "
            f"({rounded(missed[k], 3, sign=True)} A.h in {took_s} s) after {samples.place(k)}."
        )
    return notes


def unreturned_charge(trajectory: Trajectory) -> UnreturnedCharge | None:
    """The charge that a record of one cycle does not bring back; None where it brings it back, or need not."""
    first, last = trajectory.steps[0], trajectory.steps[-1]
    if first is last or first.kind is not StepKind.REST or last.kind is not StepKind.REST:
        return None
    if np.all(trajectory.current >= 0.0) or np.all(trajectory.current <= 0.0):
        return None  # a pulse, behind which the voltage comes back though the charge does not
    # What a cell shows after a silence is of another temperature, and perhaps of another charge.
    silent = [int(k) for k in gaps_in(trajectory) if k >= last.start]
    began_v, ended_v = resting_voltage(trajectory), trajectory.voltage[silent[0] if silent else last.stop - 1]
    drawn = trajectory.discharge_capacity
    passing = np.abs(trajectory.current) > 0.0
    hours = float(np.sum(np.diff(trajectory.time)[passing[:-1]])) / SECONDS_PER_HOUR
    net, size = float(drawn[-1]), float(np.ptp(drawn))
    if abs(ended_v - began_v) > SAME_REST_V or abs(net) < NOT_BACK_SHARE * size or len(trajectory.cycles) > 1:
        return None
    between = _drawn_over(trajectory, first.stop, began_v - float(ended_v))
    if abs(between) > _TOLD * abs(net):
        return None  # on a flat open-circuit curve (LFP) two rest voltages tell little of the charge
    return UnreturnedCharge(began_v, float(ended_v), net, size, between, hours)


def _drawn_over(trajectory: Trajectory, start: int, fall_v: float) -> float:
    """The charge over which a slow record falls by so much behind a sample, A.h; infinite if it never does."""
    behind = slice(start + 1, None)  # The first sample under load has fallen by the cell's resistance.
    voltage, drawn = trajectory.voltage[behind], trajectory.discharge_capacity[behind]
    there = np.abs(voltage - voltage[:1]) >= abs(fall_v)
    return float(np.copysign(drawn[np.argmax(there)] - drawn[0], fall_v)) if np.any(there) else np.inf


def _of_offset(trajectory: Trajectory) -> list[str]:
    found = unreturned_charge(trajectory)
    if found is None:
        return []
    way = "more is drawn than charged" if found.net_ah > 0 else "more is charged than drawn"
    return [
        f"it begins at rest at {found.began_v:.3f} V and ends so at {found.ended_v:.3f} V, yet "
        f"{rounded(abs(found.net_ah), 3)} A.h {way} "
        f"({100 * abs(found.net_ah) / found.range_ah:.2g} %): an offset of the current of "
        f"{1e3 * abs(found.offset_a):.2g} mA would explain it (--current-offset {-found.offset_a:.2g})."
    ]


def _of_drift(trajectory: Trajectory) -> list[str]:
    """The net charge from one full charge to the next, which a sound record brings back to where it was."""
    drawn = trajectory.discharge_capacity
    ends = _ends_of_charges(trajectory)
    if len(ends) < DRIFT_CYCLES:
        return []
    capacity = float(np.median([np.ptp(drawn[one : two + 1]) for one, two in pairwise(ends)]))
    each = np.diff(drawn[ends])
    drift = float(np.median(each))
    if capacity == 0.0 or abs(drift) < DRIFT_SHARE * capacity:
        return []
    way = "more is drawn than charged" if drift > 0 else "more is charged than drawn"
    return [
        f"the net charge drifts by {drift:+.3g} A.h a cycle ({100 * abs(drift) / capacity:.2g} % of a cycle's charge; "
        f"{way}), {drawn[ends[-1]] - drawn[ends[0]]:+.3g} A.h over {len(ends) - 1} cycles: use single cycles, not the "
        "running sum."
    ]


def _ends_of_charges(trajectory: Trajectory) -> list[int]:
    """The last samples of each cycle's charge, where it reaches the record's upper voltage."""
    top = float(np.quantile(trajectory.voltage, 0.999))
    ends: dict[int, int] = {}
    for step in trajectory.steps:
        charging = trajectory.current[step.start : step.stop].mean() < 0
        if charging and step.kind in (StepKind.CC_CHARGE, StepKind.CV_HOLD):
            ends[step.cycle] = step.stop - 1
    return [end for end in ends.values() if trajectory.voltage[end] > top - FULL_V]
