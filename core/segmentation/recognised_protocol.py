"""The protocol that a record shows: its steps as a cycler would be told them."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import BsaError
from ..printable import shown
from ..trajectory import FloatArray, Step, StepKind, Trajectory

_AT_LIMIT_V = 0.01
"""A step of constant current that ends this close to the record's extreme voltage, V, ended by that limit."""

_FALLING = 0.9
"""Share of its first current below which the last one of a voltage hold ended it."""


def with_switches(record: Trajectory) -> Trajectory:
    """The record with each step begun where the one before ended.

    Cyclers write the last sample of a step as it ends, and the first one up to an interval late. A sample is inserted
    at the switch: else the interval would be a ramp of the current that never was. A rest that is written far less
    often than the load after it goes on until that load's own interval before its first sample.
    """
    copies: list[tuple[int, int, float]] = []  # Where a sample is inserted, which one it copies, and its time.
    for before, step in pairwise(record.steps):
        ended, seen = float(record.time[step.start - 1]), float(record.time[step.start])
        if seen == ended:
            continue
        begun = max(ended, seen - late_s(record, step)) if before.kind is StepKind.REST else ended
        if begun > ended:
            copies.append((step.start, step.start - 1, begun))
        copies.append((step.start, step.start, begun))
    at, copied = [place for place, _, _ in copies], [sample for _, sample, _ in copies]
    times = [begun for _, _, begun in copies]
    places = np.insert(np.arange(len(record)), at, copied)
    starts = [int(np.searchsorted(places, step.start)) for step in record.steps]
    steps = [
        replace(step, start=start, stop=stop)
        for step, start, stop in zip(record.steps, starts, [*starts[1:], len(places)], strict=True)
    ]
    met = record.picked(places, tuple(steps))
    return replace(met, time=np.insert(record.time, at, times), inserted=np.insert(record.inserted, at, True))


def late_s(record: Trajectory, step: Step) -> float:
    """How long after its beginning the first sample of a step may have been written, s: its usual interval, and a half.

    Without end for a step of one sample, which has no interval.
    """
    spacing = np.diff(record.time[step.start : step.stop])
    return 1.5 * float(np.median(spacing)) if len(spacing) else float("inf")


@dataclass(frozen=True)
class SeenStep:
    """A step as a record shows it."""

    kind: StepKind  # What was done.
    # seconds, amperes: How long, and at which current (median, positive on discharge).
    seconds: float
    amperes: float
    # volts, last_volts: Median voltage and the last one.
    volts: float
    last_volts: float
    last_amperes: float  # Size of the last current.
    at_limit: bool  # Whether it ended at the record's highest voltage, or its lowest.
    falls: bool  # Whether the current of a hold fell until it ended.

    def __str__(self) -> str:
        for_time = f"for {max(self.seconds, 1.0):.0f} seconds"
        if self.kind is StepKind.REST:
            return f"Rest {for_time}"
        if self.kind is StepKind.CV_HOLD:
            return f"Hold at {self.volts:.3f} V " + (f"until {self.last_amperes:.4g} A" if self.falls else for_time)
        until = f"until {self.last_volts:.3f} V" if self.at_limit else for_time
        return f"{'Discharge' if self.amperes > 0 else 'Charge'} at {abs(self.amperes):.5g} A {until}"


def recognised_protocol(record: Trajectory, name: str) -> tuple[tuple[str, ...], ...]:
    """Cycles of steps in amperes and volts, as PyBaMM step strings.

    Charges and discharges end by voltage where they come to the record's highest or lowest, holds by current where it
    falls; all else by time. The record is cut into steps that begin where the one before ended (`with_switches`);
    ``name`` is for messages. Raises `BsaError` if a step is none that a protocol has, such as a drive cycle.
    """
    limits = voltage_limits(record)
    return tuple(tuple(str(step) for step in seen_steps(record.cycle(n), limits, name)) for n in record.cycles)


def voltage_limits(record: Trajectory) -> tuple[float, float]:
    """The record's lowest and highest voltage, V."""
    return float(record.voltage.min()), float(record.voltage.max())


def seen_steps(record: Trajectory, limits: tuple[float, float], name: str) -> list[SeenStep]:
    """The steps of a record that begin where the one before ended.

    Raises `BsaError` if a step is none that a protocol has, such as a drive cycle.
    """
    return [_seen(piece, step, limits, name) for step, piece in record.pieces()]


def _seen(piece: Trajectory, step: Step, limits: tuple[float, float], name: str) -> SeenStep:
    if not isinstance(step.kind, StepKind) or step.kind is StepKind.DRIVE:
        raise BsaError(
            f'{name} has a step "{shown(step.kind)}" at {piece.time[0]:.0f} s, which no protocol tells.',
            "leave out --as-protocol and --life: the measured current then drives the model.",
        )
    current, voltage = piece.current, piece.voltage
    amperes, first, last = _middle(current), abs(float(current[0])), abs(float(current[-1]))
    limit = limits[0] if amperes > 0 else limits[1]
    return SeenStep(
        kind=step.kind,
        seconds=piece.duration,
        amperes=amperes,
        volts=_middle(voltage),
        last_volts=float(voltage[-1]),
        last_amperes=last,
        at_limit=bool(abs(voltage[-1] - limit) < _AT_LIMIT_V),
        falls=0.0 < last < _FALLING * first,
    )


def _middle(values: FloatArray) -> float:
    return float(sorted(values)[len(values) // 2])
