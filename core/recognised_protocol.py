"""The protocol that a record shows: its steps as a cycler would be told them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .errors import BsaError
from .printable import shown
from .trajectory import FloatArray, Step, StepKind, Trajectory

_AT_LIMIT_V = 0.01
"""A step of constant current that ends this close to the record's extreme voltage, V, ended by that limit."""

_FALLING = 0.9
"""Share of its first current below which the last one of a voltage hold ended it."""


def with_switches(record: Trajectory) -> Trajectory:
    """The record with each step begun where the one before ended.

    Cyclers write the first sample of a step one interval late. That sample's values are put at the switch too: else the
    interval would be a ramp of the current that never was.
    """
    late = [step.start for step in record.steps[1:] if record.time[step.start] > record.time[step.start - 1]]
    places = np.insert(np.arange(len(record)), late, late)
    time = np.insert(record.time, late, record.time[np.array(late, dtype=np.intp) - 1])
    begun = [int(np.searchsorted(places, step.start)) for step in record.steps]
    steps = [
        replace(step, start=start, stop=stop)
        for step, start, stop in zip(record.steps, begun, [*begun[1:], len(places)], strict=True)
    ]
    signals = {name: values[places] for name, values in record.signals.items()}
    return Trajectory(time, steps=tuple(steps), signals=signals)


def recognised_protocol(record: Trajectory, name: str) -> tuple[tuple[str, ...], ...]:
    """Cycles of steps in amperes and volts, as PyBaMM step strings.

    Charges and discharges end by voltage where they come to the record's highest or lowest, holds by current where it
    falls; all else by time.

    Parameters
    ----------
    record : Trajectory
        Cut into steps that begin where the one before ended (`with_switches`).
    name : str
        The record's, for messages.

    Raises
    ------
    BsaError
        If a step is none that a protocol has, such as a drive cycle.
    """
    limits = float(record.voltage.min()), float(record.voltage.max())
    return tuple(
        tuple(_told(record, step, limits, name) for step in record.steps if step.cycle == cycle)
        for cycle in record.cycles
    )


def _told(record: Trajectory, step: Step, limits: tuple[float, float], name: str) -> str:
    current, voltage = (values[step.start : step.stop] for values in (record.current, record.voltage))
    seconds = float(record.time[step.stop - 1] - record.time[step.start])
    for_time = f"for {max(seconds, 1.0):.0f} seconds"
    if step.kind is StepKind.REST:
        return f"Rest {for_time}"
    if step.kind is StepKind.CV_HOLD:
        first, last = abs(float(current[0])), abs(float(current[-1]))
        falls = 0.0 < last < _FALLING * first
        return f"Hold at {_middle(voltage):.3f} V " + (f"until {last:.4g} A" if falls else for_time)
    if step.kind not in (StepKind.CC_CHARGE, StepKind.CC_DISCHARGE, StepKind.PULSE):
        raise BsaError(
            f'{name} has a step "{shown(step.kind)}" at {record.time[step.start]:.0f} s, which no protocol tells.',
            "leave out --as-protocol: the measured current then drives the model.",
        )
    amperes = _middle(current)
    limit = limits[0] if amperes > 0 else limits[1]
    until = f"until {voltage[-1]:.3f} V" if abs(voltage[-1] - limit) < _AT_LIMIT_V else for_time
    return f"{'Discharge' if amperes > 0 else 'Charge'} at {abs(amperes):.5g} A {until}"


def _middle(values: FloatArray) -> float:
    return float(sorted(values)[len(values) // 2])
