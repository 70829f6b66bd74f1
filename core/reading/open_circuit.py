"""What a record shows of the open-circuit voltage: by slow charges and discharges, and after long rests."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..trajectory import SECONDS_PER_HOUR, FloatArray, Step, StepKind, Trajectory

SLOW_HOURS = 8.0
"""A charge or discharge at constant current that takes longer shows the open-circuit voltage nearly bare, in h: C/10 of
the nominal capacity, of which a measured cell gives down to five sixths."""

SLOW_SWING_V = 0.5
"""A slow curve crosses at least this much voltage, in V."""

RELAXED_S = 600.0
"""What a rest shows after ten minutes is the open-circuit voltage to a few mV, except at the ends of the curve."""

_FASTEST_HOURS = 0.7
"""Length of a charge or discharge from which it tells whose potentials a cell has where none is slow, h. Six records at
C/2 and 1C of five measured cells come out with a positive electrode of their own chemistry, at 2C one of two does
(docs/real-cells-results.md)."""

_POINTS = 200
"""Points of a curve of charges and discharges, at equal charges."""

_COVERED = 0.5
"""Share of a record's charge that a curve crosses at least: less does not tell how the electrodes are balanced."""

_INTERRUPTION_S, _SAME_CURRENT = 60.0, 0.05
"""Rests up to this long interrupt a charge or discharge and do not end it, where the current behind them is the same to
this share: intermittent current interruption has rests of 1 to 10 s."""

_RESTS, _APART, _WIDEST = 8, 0.005, 0.2
"""Rests that make a curve at least, twice the stoichiometries that are fitted to it, and by what share of its charge
two neighbours differ at least and at most. A pulse test has a rest at every tenth of the charge; the rests of cycles
are all at its ends."""


@dataclass(frozen=True, eq=False)
class OpenCircuitCurve:
    """The open-circuit voltage of a cell by the charge that was drawn, as records show it; shapes are (n,)."""

    share: FloatArray  # Charge drawn since the fullest point, from 0 to 1 at the emptiest; rises.
    voltage: FloatArray  # Halfway between charge and discharge where both were measured, V.
    charge_ah: float  # Charge between these points.
    polarised: int  # 1 or -1 where the voltage is that of discharges or of charges alone, otherwise 0.
    # By how much the charge lies above the discharge at the same charge, median, V; NaN where one was not measured.
    gap_v: float
    hours: float  # What the faster of its charges and discharges took, h; infinite for rests.
    words: str  # What it was read from: ``"the slow record"``.


@dataclass(frozen=True, eq=False)
class SteadyStretch:
    """A charge or discharge at one current, which short rests may interrupt."""

    kind: StepKind
    places: NDArray[np.intp]  # Its samples under current, shape (k,).
    hours: float  # Time under current.


def open_circuit_curve(records: Sequence[Trajectory]) -> OpenCircuitCurve | None:
    """The best that records show: slow charges and discharges, else long rests, else a faster one, up to about 1C."""
    rested = (_rested_curve(record) for record in records)
    faster = (_steady_curve(record, _FASTEST_HOURS) for record in records)
    return slow_curve(records) or _widest(rested) or _widest(faster)


def slow_curve(records: Iterable[Trajectory]) -> OpenCircuitCurve | None:
    """The curve of the record whose slow charges and discharges cross most charge; None if none crosses enough."""
    return _widest(_steady_curve(record, SLOW_HOURS) for record in records)


def steady_stretches(record: Trajectory) -> Iterator[SteadyStretch]:
    """A record's charges and discharges at constant current, in order of time."""
    joined: list[Step] = []
    for number, step in enumerate(record.steps):
        if step.kind not in (StepKind.CC_CHARGE, StepKind.CC_DISCHARGE):
            continue
        if joined and not _goes_on(record, joined[-1], number):
            yield _stretch(record, joined)
            joined = []
        joined.append(step)
    if joined:
        yield _stretch(record, joined)


def _goes_on(record: Trajectory, last: Step, number: int) -> bool:
    """Whether a step is a charge or discharge that goes on behind a short rest."""
    step, between = record.steps[number], record.steps[number - 1]
    if between.kind is not StepKind.REST or record.steps[number - 2] is not last or step.kind is not last.kind:
        return False
    before, now = (float(np.median(record.current[one.start : one.stop])) for one in (last, step))
    return _seconds(record, between) <= _INTERRUPTION_S and abs(now - before) <= _SAME_CURRENT * abs(before)


def _stretch(record: Trajectory, steps: Sequence[Step]) -> SteadyStretch:
    places = np.concatenate([np.arange(step.start, step.stop) for step in steps])
    hours = sum(_seconds(record, step) for step in steps) / SECONDS_PER_HOUR
    return SteadyStretch(StepKind(steps[0].kind), places, hours)


def _seconds(record: Trajectory, step: Step) -> float:
    return float(record.time[step.stop - 1] - record.time[step.start])


def _widest(curves: Iterable[OpenCircuitCurve | None]) -> OpenCircuitCurve | None:
    return max((curve for curve in curves if curve is not None), key=lambda curve: curve.charge_ah, default=None)


def _steady_curve(record: Trajectory, least_hours: float) -> OpenCircuitCurve | None:
    """The curve of the longest charge and the longest discharge of so many hours."""
    drawn = record.discharge_capacity
    measured: dict[StepKind, tuple[FloatArray, FloatArray, float]] = {}
    for found in steady_stretches(record):
        charge, voltage = drawn[found.places], record.voltage[found.places]
        longest = measured.get(found.kind)
        slow = found.hours >= least_hours and np.ptp(voltage) >= SLOW_SWING_V
        if slow and (longest is None or np.ptp(longest[0]) < np.ptp(charge)):
            order = np.argsort(charge, kind="stable")
            measured[found.kind] = charge[order], voltage[order], found.hours
    if not measured:
        return None
    if not _overlap([charge for charge, _, _ in measured.values()]):
        widest = max(measured, key=lambda kind: float(np.ptp(measured[kind][0])))
        measured = {widest: measured[widest]}
    first, last = (float(end([end(charge) for charge, _, _ in measured.values()])) for end in (np.min, np.max))
    if last - first < _COVERED * np.ptp(drawn):
        return None
    at = np.linspace(first, last, _POINTS)
    curves = [np.interp(at, charge, voltage, left=np.nan, right=np.nan) for charge, voltage, _ in measured.values()]
    polarised = 0 if len(curves) > 1 else 1 if StepKind.CC_DISCHARGE in measured else -1
    voltage = _halfway(at, *curves) if len(curves) > 1 else curves[0]
    gap_v = float(np.nanmedian(np.abs(curves[1] - curves[0]))) if len(curves) > 1 else np.nan
    hours = min(hours for *_, hours in measured.values())
    share = (at - first) / (last - first)
    return OpenCircuitCurve(share, voltage, last - first, polarised, gap_v, hours, _steady_words(hours))


def _steady_words(hours: float) -> str:
    if hours >= SLOW_HOURS:
        return "the slow record"
    return f"the record at about {1.0 / hours:.1g}C (none is slow; it tells the chemistry, the rest roughly)"


def _overlap(charges: Sequence[FloatArray]) -> bool:
    """Whether rising charges have more than a step between points in common; one alone overlaps with itself."""
    starts, ends = [charge[0] for charge in charges], [charge[-1] for charge in charges]
    return bool(min(ends) - max(starts) > (max(ends) - min(starts)) / (_POINTS - 1))


def _halfway(at: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """The mean of two curves; where only one is known, that one moved by half of the distance where both last were."""
    both = np.isfinite(one) & np.isfinite(other)
    half = 0.5 * np.interp(at, at[both], (other - one)[both])
    return np.where(np.isfinite(one), one + half, other - half)


def rested_places(record: Trajectory) -> NDArray[np.intp]:
    """Where long rests end that make a curve, by the charge drawn; none where they do not.

    They are those behind discharges, or behind charges if these cross more charge. The two are not combined: straight
    lines between few points do not tell one from the other.
    """
    places, drawn = np.array(list(_ends_of_rests(record)), dtype=np.intp), record.discharge_capacity
    if len(places) < _RESTS:
        return places[:0]
    behind = np.sign(np.diff(drawn[places]))
    behind = np.concatenate([behind[:1], behind])  # the first rest is where the second one's current began
    chosen = _apart(places[behind == 1], drawn), _apart(places[behind == -1], drawn)
    widest = max(chosen, key=lambda found: float(np.ptp(drawn[found])) if len(found) else 0.0)
    charge = drawn[widest]
    if len(widest) < _RESTS or np.ptp(charge) < _COVERED * np.ptp(drawn):
        return places[:0]
    return widest if np.max(np.diff(charge)) <= _WIDEST * np.ptp(charge) else places[:0]


def _rested_curve(record: Trajectory) -> OpenCircuitCurve | None:
    places = rested_places(record)
    if not len(places):
        return None
    charge, words = record.discharge_capacity[places], f"the voltages at the end of {len(places)} rests"
    span = float(np.ptp(charge))
    return OpenCircuitCurve((charge - charge[0]) / span, record.voltage[places], span, 0, np.nan, np.inf, words)


def _ends_of_rests(record: Trajectory) -> Iterator[int]:
    """Places of the last measured sample of each long rest."""
    for step in record.steps:
        measured = np.flatnonzero(~record.inserted[step.start : step.stop])
        if step.kind is StepKind.REST and len(measured) and _seconds(record, step) >= RELAXED_S:
            yield step.start + int(measured[-1])


def _apart(places: NDArray[np.intp], drawn: FloatArray) -> NDArray[np.intp]:
    """Places in order of rising charge, without those that are hardly farther than the one before."""
    places = places[np.argsort(drawn[places], kind="stable")]
    least = _APART * float(np.ptp(drawn[places])) if len(places) else 0.0
    kept: list[int] = []
    for place in places.tolist():
        if not kept or drawn[place] - drawn[kept[-1]] > least:
            kept.append(place)
    return np.array(kept, dtype=np.intp)
