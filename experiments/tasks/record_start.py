"""What a record shows of the state from which it starts, and of the resistance of its cell."""

from collections.abc import Sequence

import numpy as np

from ...core.reading.switches import begins_under_load, resting_voltage, switches
from ...core.trajectory import StepKind, Trajectory

_PROMPT_S, _NEARLY_EMPTY = 10.0, 0.1
"""Latest sample after a current step that shows its resistance, s, and the share of the voltage range at whose bottom
none does: a minute late, or at the end of a discharge, the same cells show two to ten times as much."""

_LARGE_JUMP = 0.2
"""Share of the record's largest current; smaller jumps of the current are left out."""

_SAME_SHARE = 0.1
"""Share of what the voltage falls from a record's first sample to its second by which the first voltages of two records
may differ that were both taken before the load: under it they would differ by about as much as the currents do."""


def starts_at_rest(record: Trajectory, others: Sequence[Trajectory] = ()) -> bool:
    """Whether a record's first voltage is that of an open circuit, for all that is known of ``others`` of the cell.

    The first sample may have been taken before the current was switched on, although a current stands beside it. Then
    another record, of another current, begins with the same voltage.
    """
    if record.steps[0].kind is StepKind.REST or not begins_under_load(record):
        return True
    return any(begins_under_load(other) and _before_load(record, other) for other in others)


def _before_load(one: Trajectory, other: Trajectory) -> bool:
    """Whether the first voltages of two records that begin with a current are alike, and their next ones are not."""
    falls = [abs(float(record.voltage[1] - record.voltage[0])) for record in (one, other)]
    unlike = abs(falls[0] - falls[1])
    return abs(float(one.voltage[0] - other.voltage[0])) < _SAME_SHARE * unlike


def open_circuit_start(record: Trajectory, others: Sequence[Trajectory] = ()) -> tuple[float, str]:
    """The open-circuit voltage that a record starts from, V, and how it is known.

    A voltage under load is none: what the current's steps show as resistance is put back, or, where it has none, the
    steps of ``others`` of the same cell.
    """
    voltage = resting_voltage(record)
    if starts_at_rest(record, others):
        first = next(switches(record), None)
        early = first is not None and first.mixed is not None and first.mixed < record.steps[0].stop
        why = " (its last sample at rest has the voltage under load already)" * early
        return voltage, f"starts at {voltage:.3f} V{why}"
    current, jumps, whose = float(record.current[0]), jump_resistances(record), "its"
    if not jumps and others:
        jumps, whose = [ohm for other in others for ohm in jump_resistances(other)], "the other records'"
    ohm = float(np.median(jumps)) if jumps else 0.0
    flow, truth = ("discharge", "higher") if current > 0 else ("charge", "lower")
    begins = f"begins under load ({voltage:.3f} V at {abs(current):.3g} A of {flow})"
    if not jumps:
        return voltage, (
            f"{begins}, and no current step shows its resistance: this voltage is assumed to be the open-circuit "
            f"voltage, which is {truth} (give --initial-soc where it is known)"
        )
    return voltage + ohm * current, (
        f"{begins}: with {1e3 * ohm:.3g} mohm, which {whose} current steps show, the open-circuit voltage is assumed "
        f"to be {voltage + ohm * current:.3f} V (give --initial-soc where it is known)"
    )


def with_room_for(record: Trajectory, soc: float, capacity_ah: float, others: Sequence[Trajectory] = ()) -> float:
    """The state of charge nearest to ``soc`` from which a record that begins under load can be passed at all.

    A cell gives no more than it holds, and takes no more than it has room for. Over later cycles the count drifts.
    """
    if starts_at_rest(record, others):
        return soc
    drawn = record.cycle(record.cycles[0]).discharge_capacity / capacity_ah
    lowest, highest = min(float(np.max(drawn)), 1.0), max(1.0 + float(np.min(drawn)), 0.0)
    return float(np.clip(soc, lowest, highest)) if lowest <= highest else soc


def jump_resistances(record: Trajectory) -> list[float]:
    """Voltage jump over current jump where one step follows another, Ohm.

    Left out are jumps that the record shows too late, and those of a cell that is nearly empty: both hold more
    diffusion than resistance.
    """
    places = [(switch.before, switch.after) for switch in switches(record)]
    last, first = np.array(places, dtype=np.intp).reshape(-1, 2).T
    current, voltage = record.current[first] - record.current[last], record.voltage[first] - record.voltage[last]
    large = np.abs(current) > _LARGE_JUMP * np.max(np.abs(record.current), initial=1e-9)
    prompt = record.time[first] - record.time[last] <= _PROMPT_S
    nearly_empty = record.voltage[last] < record.voltage.min() + _NEARLY_EMPTY * np.ptp(record.voltage)
    shown = large & prompt & ~nearly_empty
    return [float(value) for value in -voltage[shown] / current[shown] if value > 0]
