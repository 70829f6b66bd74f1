"""From curves to the lines of a cycle table."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from ..trajectory import FloatArray, Step, StepKind, Trajectory
from .cycle_table import COLUMNS, LOSSES, CycleTable

DISCHARGES = (StepKind.CC_DISCHARGE, StepKind.DRIVE)
_CHARGES = (StepKind.CC_CHARGE, StepKind.CV_HOLD)

_LEAST_JUMP = 0.2
"""Share of the discharge current that must be switched on at once for the voltage step to give a resistance."""

_PROMPT_S = 1.0
"""Latest sample after the current is switched on that shows a resistance, s: later, diffusion adds to it, a third
within half a minute."""


def discharged_ah(record: Trajectory) -> float:
    """Charge drawn during the discharge steps of a record, A.h; pulses and rests left out."""
    return sum(
        max(float(piece.discharge_capacity[-1]), 0.0) for step, piece in record.pieces() if step.kind in DISCHARGES
    )


def resistance_ohm(record: Trajectory, first_v: float = float("nan")) -> float:
    """Voltage drop over current where the first discharge sets in, ohm; NaN without samples right before and after.

    ``first_v`` is the voltage after the switch, V; NaN for that of the first sample there.
    """
    step, places = _first_switch(record)
    if step is None or places is None:
        return float("nan")
    current, voltage = (record.values(name)[list(places)] for name in ("current", "voltage"))
    after_v = voltage[1] if np.isnan(first_v) else first_v
    jump = float(np.diff(current)[0])
    largest = float(np.max(np.abs(record.current[step.start : step.stop])))
    return -float(after_v - voltage[0]) / jump if jump > _LEAST_JUMP * largest else float("nan")


def resistance_delay_s(record: Trajectory) -> float:
    """How long after the switch a measured record reads its resistances, s: the median of its cycles; 0 without any.

    Of a record with a cycle table only the cycles count whose curves are kept.
    """
    cycles = [record.cycle(number) for number in record.cycles]
    switches = [(cycle, _first_switch(cycle)[1]) for cycle in cycles]
    delays = [cycle.time[places[1]] - cycle.time[places[0]] for cycle, places in switches if places is not None]
    return float(np.median(delays)) if delays else 0.0


def _first_switch(record: Trajectory) -> tuple[Step | None, tuple[int, int] | None]:
    """The first discharge, and the places right before and after it sets in; None without prompt samples there."""
    step = next((step for step in record.steps if step.kind in DISCHARGES), None)
    places = None if step is None else record.measured_across(step)
    late = places is not None and record.time[places[1]] - record.time[places[0]] > _PROMPT_S
    return step, None if late else places


def rested_voltage_v(record: Trajectory) -> float:
    """Voltage at the end of the last charge, after the rest that follows it, V; NaN without a charge."""
    charges = [place for place, step in enumerate(record.steps) if step.kind in _CHARGES]
    if not charges:
        return float("nan")
    after = record.steps[charges[-1] : charges[-1] + 2]
    last = after[-1] if after[-1].kind is StepKind.REST else after[0]
    return float(record.voltage[last.stop - 1])


def line_of(
    number: int, record: Trajectory, losses: Sequence[float] = (), first_v: float = float("nan")
) -> tuple[float, ...]:
    """A cycle's line of a `CycleTable`, given its curves and, of a simulation, what was lost (`LOSSES`).

    ``first_v``: as for `resistance_ohm`.
    """
    lost = tuple(losses) or (float("nan"),) * len(LOSSES)
    return number, discharged_ah(record), resistance_ohm(record, first_v), rested_voltage_v(record), *lost


def table_of(lines: Sequence[tuple[float, ...]]) -> CycleTable | None:
    """The table of lines in order; cycles without a discharge are left out. None if no cycle has one."""
    kept = [line for line in lines if line[1] > 0]
    return CycleTable(*np.array(kept).T) if kept else None


def filled(table: CycleTable) -> CycleTable:
    """The table with all cycles between its first and its last, by a cubic spline through the known ones."""
    cycles = np.arange(table.cycle[0], table.cycle[-1] + 1.0)
    if len(cycles) == len(table):
        return table
    return CycleTable(cycles, *(_through(table.cycle, getattr(table, name), cycles) for name in COLUMNS))


def _through(known: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    there = np.isfinite(values)
    if np.count_nonzero(there) < 2:
        return np.where(np.isin(wanted, known[there]), np.nanmean(values) if np.any(there) else np.nan, np.nan)
    found = CubicSpline(known[there], values[there], extrapolate=False)(wanted)
    return np.asarray(found, dtype=np.float64)


def in_sequence(cycles: Sequence[tuple[int, Trajectory]], table: CycleTable | None = None) -> Trajectory:
    """Cycles by number and curves as one record: each begins where the one before it ends, whatever lies between."""
    first = cycles[0][1]
    times: list[FloatArray] = []
    steps: list[Step] = []
    clock, count = 0.0, 0
    for number, record in cycles:
        times.append(record.time - record.time[0] + clock)
        steps += [
            replace(step, start=step.start + count, stop=step.stop + count, cycle=number) for step in record.steps
        ]
        clock, count = float(times[-1][-1]), count + len(record)
    signals = {name: np.concatenate([record.values(name) for _, record in cycles]) for name in first.signals}
    inserted = np.concatenate([record.inserted for _, record in cycles])
    return Trajectory(np.concatenate(times), steps=tuple(steps), signals=signals, cycle_table=table, inserted=inserted)
