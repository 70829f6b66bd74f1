"""What a record says by itself: steps, cycles, resistances at current steps, and a slow curve."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.constants import zero_Celsius

from ..printable import rounded
from ..record import Record
from ..segmentation.recognised_protocol import late_s, voltage_limits, with_switches
from ..trajectory import SECONDS_PER_HOUR, FloatArray, Step, StepKind, Trajectory
from .charge import NOTED_SHARE
from .counters import LATE_S
from .open_circuit import SLOW_HOURS, SLOW_SWING_V, rested_places, steady_stretches
from .switches import STEP_SHARE, begins_under_load, mixed_samples_note, switches


@dataclass(frozen=True)
class StepRow:
    """One step: times in s, current in A and charge in A.h positive on discharge, voltages in V.

    The current is the median; that of a hold or a drive, which has no usual one, the mean over time.
    """

    kind: str
    cycle: int
    start_s: float
    duration_s: float
    current_a: float
    charge_ah: float
    first_v: float
    last_v: float


@dataclass(frozen=True)
class CycleRow:
    """One cycle: charges in A.h, temperature in degC."""

    cycle: int
    charged_ah: float
    discharged_ah: float
    warmest_c: float | None


@dataclass(frozen=True)
class ResistanceRow:
    """Voltage over current where the current switches.

    ``after_s`` is the time between the two samples: beyond a second, slower processes are part of the resistance.
    """

    time_s: float
    voltage: float
    current_change_a: float
    after_s: float
    ohm: float


@dataclass(frozen=True)
class SlowCurve:
    """A charge or discharge so slow that its voltage is nearly that of an open circuit."""

    kind: str
    start_s: float
    hours: float
    charge_ah: float
    first_v: float
    last_v: float


@dataclass(frozen=True)
class RestRow:
    """The open-circuit voltage at the end of a long rest; the charge is drawn since the fullest one."""

    time_s: float
    charge_ah: float
    voltage: float


@dataclass(frozen=True)
class RecordSummary:
    """What a record says."""

    name: str  # The record's.
    # samples, duration_s, interval_s: Number of samples, seconds in all, and the least, the usual and the longest
    # interval in s.
    samples: int
    duration_s: float
    interval_s: tuple[float, float, float]
    # voltage, current: Least and largest, V and A (positive on discharge).
    voltage: tuple[float, float]
    current: tuple[float, float]
    temperature_c: tuple[float, float, float] | None  # First, least and largest, degC.
    ambient_c: float | None  # Around the cell.
    # steps, cycles, resistances, slow: In order of time.
    steps: tuple[StepRow, ...]
    cycles: tuple[CycleRow, ...]
    resistances: tuple[ResistanceRow, ...]
    slow: tuple[SlowCurve, ...]
    rests: tuple[RestRow, ...]  # By rising charge, where long rests make an open-circuit curve.
    problems: tuple[str, ...]  # What was assumed, repaired or cannot be trusted.


def summary(record: Record) -> RecordSummary:
    """Look at a record without any model."""
    trajectory = record.trajectory
    spacing = np.diff(trajectory.time)
    spacing = spacing[spacing > 0] if np.any(spacing > 0) else np.zeros(1)
    celsius = None if trajectory.temperature is None else trajectory.temperature - zero_Celsius
    met = with_switches(trajectory)  # steps that meet, without a ramp of the current between them
    drawn = met.discharge_capacity
    steps = tuple(_step_row(met, drawn, step) for step in met.steps)
    return RecordSummary(
        name=record.name,
        samples=len(trajectory),
        duration_s=trajectory.duration,
        interval_s=(float(spacing.min()), float(np.median(spacing)), float(spacing.max())),
        voltage=voltage_limits(trajectory),
        current=(float(trajectory.current.min()), float(trajectory.current.max())),
        temperature_c=None if celsius is None else (float(celsius[0]), float(celsius.min()), float(celsius.max())),
        ambient_c=None if record.ambient_k is None else record.ambient_k - zero_Celsius,
        steps=steps,
        cycles=tuple(_cycle_rows(met, drawn)),
        resistances=tuple(_resistances(trajectory)),
        slow=tuple(_slow_curves(met, drawn)),
        rests=tuple(_rests(met, drawn)),
        problems=(*record.notes, *_problems(record, steps)),
    )


def _step_row(trajectory: Trajectory, drawn: FloatArray, step: Step) -> StepRow:
    inside = slice(step.start, step.stop)
    time, voltage = trajectory.time[inside], trajectory.voltage[inside]
    duration = float(time[-1] - time[0])
    charge, current = float(drawn[step.stop - 1] - drawn[step.start]), float(np.median(trajectory.current[inside]))
    if step.kind in (StepKind.CV_HOLD, StepKind.DRIVE) and duration > 0.0:
        current = SECONDS_PER_HOUR * charge / duration
    return StepRow(
        kind=str(step.kind),
        cycle=step.cycle,
        start_s=float(time[0]),
        duration_s=duration,
        current_a=current,
        charge_ah=charge,
        first_v=float(voltage[0]),
        last_v=float(voltage[-1]),
    )


def _cycle_rows(trajectory: Trajectory, drawn: FloatArray) -> Iterator[CycleRow]:
    steps: dict[int, list[Step]] = {}
    for step in trajectory.steps:
        steps.setdefault(step.cycle, []).append(step)
    rising = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(drawn), 0.0))])
    for cycle, own in steps.items():
        first, last = own[0].start, own[-1].stop - 1
        discharged = float(rising[last] - rising[first])
        kelvin = trajectory.temperature
        yield CycleRow(
            cycle,
            charged_ah=max(discharged - float(drawn[last] - drawn[first]), 0.0),  # rounding may leave less than none
            discharged_ah=discharged,
            warmest_c=None if kelvin is None else float(kelvin[first : last + 1].max()) - zero_Celsius,
        )


def _resistances(trajectory: Trajectory) -> Iterator[ResistanceRow]:
    """Where a step begins or ends under current."""
    time, current, voltage = trajectory.time, trajectory.current, trajectory.voltage
    largest = float(np.max(np.abs(current), initial=0.0))
    # An instrument may write the current of a switch before its voltage: that has then moved by its last digit.
    digit = float(np.min(np.diff(np.unique(voltage)), initial=np.inf))
    digit = digit if np.isfinite(digit) else 0.0
    for switch in switches(trajectory):
        before, after = switch.before, switch.after
        change = float(current[after] - current[before])
        if change == 0.0 or abs(change) < STEP_SHARE * largest or switch.step.kind is StepKind.CV_HOLD:
            continue
        ohm = -float(voltage[after] - voltage[before]) / change
        if ohm > 0 and abs(voltage[after] - voltage[before]) > 1.5 * digit:
            passed = float(time[after] - time[before])
            yield ResistanceRow(float(time[after]), float(voltage[before]), change, passed, ohm)


def _slow_curves(trajectory: Trajectory, drawn: FloatArray) -> Iterator[SlowCurve]:
    for found in steady_stretches(trajectory):
        ends = found.places[[0, -1]]
        (first_v, last_v), charge = trajectory.voltage[ends].tolist(), abs(float(np.diff(drawn[ends])[0]))
        if found.hours >= SLOW_HOURS and abs(last_v - first_v) >= SLOW_SWING_V:
            yield SlowCurve(str(found.kind), float(trajectory.time[ends[0]]), found.hours, charge, first_v, last_v)


def _rests(trajectory: Trajectory, drawn: FloatArray) -> Iterator[RestRow]:
    places = rested_places(trajectory)
    for place in places.tolist():
        charge = float(drawn[place] - drawn[places[0]])
        yield RestRow(float(trajectory.time[place]), charge, float(trajectory.voltage[place]))


def _problems(record: Record, steps: Sequence[StepRow]) -> Iterator[str]:
    trajectory = record.trajectory
    if begins_under_load(trajectory):
        yield (
            f"the record starts under load ({-trajectory.current[0]:+.3g} A, positive on charge): its first voltage is "
            "no open-circuit voltage."
        )
    if mixed := mixed_samples_note(trajectory):
        yield mixed
    yield from _open_charge(trajectory, steps)
    if trajectory.temperature is None:
        yield "there is no temperature of the cell."


def _open_charge(trajectory: Trajectory, steps: Sequence[StepRow]) -> Iterator[str]:
    """The charge that is not known where a current is switched between two samples, and nothing tells when."""
    time, current = trajectory.time, trajectory.current
    most = max(abs(row.charge_ah) for row in steps)
    largest = float(np.max(np.abs(current), initial=0.0))
    found: list[tuple[float, float]] = []
    for last, step in pairwise(trajectory.steps):
        before, after = step.start - 1, step.start
        loaded = last if abs(current[before]) > abs(current[after]) else step
        apart_s = min(float(time[after] - time[before]), late_s(trajectory, loaded))  # a load is written more often
        change = abs(float(current[after] - current[before]))
        charge = change * apart_s / SECONDS_PER_HOUR
        if change > STEP_SHARE * largest and apart_s > LATE_S and charge > NOTED_SHARE * most:
            found.append((charge, float(time[before])))
    if found:
        charge, at_s = max(found)
        share = f" ({100 * charge / most:.2g} % of the largest)" if most > 0.0 else ""
        yield (
            f"the current is switched between samples far apart (places: {len(found)}; the most charge between two at "
            f"{rounded(at_s, 6)} s). A step is taken to begin where the one before ended; if it began later, the "
            f"charge of a step is another by up to {charge:.2g} A.h{share}."
        )
