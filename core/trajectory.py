"""Signals over time, cut into the steps of an experiment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from .ageing.cycle_table import CycleTable
from .errors import BsaError, SamplesError
from .printable import counted
from .thinning import ROUNDING, where_they_bend

FloatArray = NDArray[np.float64]

SECONDS_PER_HOUR = 3600.0


class StepKind(StrEnum):
    """What a cycler was doing during a step. Steps of other experiments have kinds in their own words."""

    REST = "rest"
    CC_CHARGE = "CC charge"
    CV_HOLD = "CV hold"
    CC_DISCHARGE = "CC discharge"
    PULSE = "pulse"
    DRIVE = "drive"
    SPECTRUM = "spectrum"


_KINDS: dict[str, StepKind] = {str(kind): kind for kind in StepKind}

LARGEST = 1e100
"""No quantity of any unit is larger, and the square of this is still a number."""


@dataclass(frozen=True)
class Step:
    """One step of a trajectory: the samples ``start`` to ``stop - 1``.

    Attributes
    ----------
    kind : str
        What was done: a `StepKind`, or for what is no cell any words, ``"free decay"``.
    start, stop : int
        First sample, and one past the last sample.
    cycle : int
        Cycle the step belongs to, counted from 1.
    label : str
        The step in the words of the protocol, if there is one.
    position : int
        Place of the step in its cycle, from 0. Gaps mean that the protocol's step was skipped.
    """

    kind: str
    start: int
    stop: int
    cycle: int = 1
    label: str = ""
    position: int = 0

    def __post_init__(self) -> None:
        # A cycler's kinds are told by identity wherever a record comes from.
        if self.kind in _KINDS:
            object.__setattr__(self, "kind", _KINDS[self.kind])


Places = slice | NDArray[np.intp]


def _size_for_drawing(values: FloatArray) -> float:
    """The range of a signal, by which its bends are measured; 0 where it is constant but for rounding."""
    swing = float(np.ptp(values)) if len(values) else 0.0
    return swing if swing > ROUNDING * float(np.max(np.abs(values), initial=0.0)) else 0.0


@dataclass(frozen=True, eq=False, init=False)
class Trajectory:
    """A simulated or measured record.

    Parameters
    ----------
    time : ndarray of shape (n,)
        Seconds, never decreasing. Two samples may share a stamp where one step ends and the next begins.
    current, voltage : ndarray of shape (n,), optional
        The signals of a cell: ampere, **positive on discharge** (the convention of PyBaMM), and volt.
    temperature : ndarray of shape (n,), optional
        Kelvin, where known.
    steps : tuple of Step
        Consecutive steps that cover all samples; empty where the record has not been cut yet.
    signals : mapping of str to ndarray of shape (n,), optional
        Any other signals by name; each in the unit of the task's `Signal` of that name.
    cycle_table : CycleTable, optional
        Of a long record, whose samples are those of a few cycles: what is known of all of them.
    inserted : ndarray of bool, shape (n,), optional
        Samples that no instrument took, put where the current was switched between two that one took. Their current is
        that of the step; their other signals are copied from the nearest sample and say nothing of that moment. A task
        marks those too that an instrument took, but with current and voltage of two moments.

    Attributes
    ----------
    signals : mapping of str to ndarray of shape (n,)
        All signals by name, those of a cell included.
    time, steps, cycle_table, inserted
        As given. A part of the record has no cycle table; no sample is inserted where nothing is said of it.
    """

    time: FloatArray
    signals: Mapping[str, FloatArray]
    steps: tuple[Step, ...]
    cycle_table: CycleTable | None
    inserted: NDArray[np.bool_]

    def __init__(
        self,
        time: FloatArray,
        current: FloatArray | None = None,
        voltage: FloatArray | None = None,
        temperature: FloatArray | None = None,
        steps: tuple[Step, ...] = (),
        signals: Mapping[str, FloatArray] | None = None,
        cycle_table: CycleTable | None = None,
        inserted: NDArray[np.bool_] | None = None,
    ) -> None:
        of_a_cell = {"current": current, "voltage": voltage, "temperature": temperature}
        given = {**(signals or {}), **{name: values for name, values in of_a_cell.items() if values is not None}}
        object.__setattr__(self, "time", np.asarray(time, dtype=np.float64))
        object.__setattr__(
            self, "signals", {name: np.asarray(values, dtype=np.float64) for name, values in given.items()}
        )
        object.__setattr__(self, "steps", steps)
        object.__setattr__(self, "cycle_table", cycle_table)
        none = np.zeros(len(self.time), dtype=np.bool_)
        object.__setattr__(self, "inserted", none if inserted is None else np.asarray(inserted, dtype=np.bool_))
        self._check()

    def _check(self) -> None:
        for name, values in {"time": self.time, **self.signals, "inserted": self.inserted}.items():
            if values.shape != np.shape(self.time) or values.ndim != 1:
                raise SamplesError(
                    f"{name} has shape {values.shape}, but time has shape {np.shape(self.time)}.",
                    "all signals of a trajectory share one time axis of shape (n,).",
                )
            wild = ~(np.abs(values) <= LARGEST)
            if np.any(wild):
                row = int(np.flatnonzero(wild)[0])
                raise SamplesError(f"{name} is {values[row]} at sample {row}.", "remove or repair the sample.")
        if len(self.time) > 1 and np.any(np.diff(self.time) < 0):
            row = int(np.flatnonzero(np.diff(self.time) < 0)[0]) + 1
            raise SamplesError(
                f"time runs backwards at sample {row} ({self.time[row - 1]:g} s, then {self.time[row]:g} s).",
                "sort the record, or cut it where the clock restarts.",
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def words(self) -> str:
        """What it holds: ``"2880 samples of current, voltage; 4.5 h; 12 steps in 2 cycles"``."""
        parts = [f"{counted(len(self), 'sample')} of {', '.join(self.signals) or 'nothing'}"]
        hours = self.duration / SECONDS_PER_HOUR
        if not any(step.kind == StepKind.SPECTRUM for step in self.steps):
            parts.append(f"{self.duration:.3g} s" if hours < 1.0 else f"{hours:.3g} h")
        if self.steps:
            parts.append(f"{counted(len(self.steps), 'step')} in {counted(len(self.cycles), 'cycle')}")
        return "; ".join(parts)

    def __repr__(self) -> str:
        return f"<Trajectory: {self.words}>"

    def values(self, name: str) -> FloatArray:
        """A signal by its name, shape (n,).

        Raises
        ------
        BsaError
            If the record has no such signal.
        """
        try:
            return self.signals[name]
        except KeyError:
            raise BsaError(
                f'a record has no signal "{name}".',
                f"it has {list(self.signals)}; every record and simulation needs the signals of its task.",
            ) from None

    @property
    def current(self) -> FloatArray:
        """Current of a cell in ampere, positive on discharge, shape (n,)."""
        return self.values("current")

    @property
    def voltage(self) -> FloatArray:
        """Voltage of a cell in volt, shape (n,)."""
        return self.values("voltage")

    @property
    def temperature(self) -> FloatArray | None:
        """Temperature in kelvin, shape (n,); None where unknown."""
        return self.signals.get("temperature")

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    @property
    def discharge_capacity(self) -> FloatArray:
        """Charge drawn since the first sample in A.h, shape (n,); falls during charge."""
        return np.concatenate([[0.0], np.cumsum(drawn_between(self.time, self.current))]) / SECONDS_PER_HOUR

    def is_same_measurement(self, other: Trajectory) -> bool:
        """Whether another record of a cell has the same samples of current and voltage, whatever is made of them."""
        return np.array_equal(self.current, other.current) and np.array_equal(self.voltage, other.voltage)

    @property
    def cycles(self) -> tuple[int, ...]:
        """The cycle numbers present, in order."""
        return tuple(sorted({step.cycle for step in self.steps}))

    def slice(self, start: int, stop: int) -> Trajectory:
        """The samples ``start`` to ``stop - 1``, with the steps that lie wholly inside."""
        steps = tuple(
            replace(step, start=step.start - start, stop=step.stop - start)
            for step in self.steps
            if step.start >= start and step.stop <= stop
        )
        return self.picked(slice(start, stop), steps)

    def cycle(self, number: int) -> Trajectory:
        """The samples of one cycle.

        Raises
        ------
        BsaError
            If the trajectory has no such cycle.
        """
        steps = [step for step in self.steps if step.cycle == number]
        if not steps:
            raise BsaError(f"the trajectory has no cycle {number}.", f"its cycles are {list(self.cycles)}.")
        return self.slice(steps[0].start, steps[-1].stop)

    def pieces(self) -> Iterator[tuple[Step, Trajectory]]:
        """Each step with its own samples."""
        for step in self.steps:
            yield step, self.slice(step.start, step.stop)

    def measured_across(self, step: Step) -> tuple[int, int] | None:
        """Places of the last sample measured before a step and of the first one measured in it; None without both."""
        before, after = step.start - 1, step.start
        while before >= 0 and self.inserted[before]:
            before -= 1
        while after < step.stop and self.inserted[after]:
            after += 1
        return (before, after) if before >= 0 and after < step.stop else None

    def thinned(self, samples_per_step: int, samples_of_drives: int = 0) -> Trajectory:
        """A copy of at most ``samples_per_step`` samples a step, its ends and bends kept; for storing and drawing.

        Steps of a varying current share ``samples_of_drives`` by their length, if that is more: straight lines between
        few of their samples are a current that never flowed.
        """
        driven = sum(step.stop - step.start for step in self.steps if step.kind is StepKind.DRIVE)
        sizes = {name: _size_for_drawing(values) for name, values in self.signals.items()}
        steps = self.steps or (Step(StepKind.DRIVE, 0, len(self)),)
        kept: list[NDArray[np.intp]] = []
        new_steps: list[Step] = []
        count = 0
        for step in steps:
            part = slice(step.start, step.stop)
            curves = [self.signals[name][part] / size for name, size in sizes.items() if size > 0.0]
            share = (
                samples_of_drives * (step.stop - step.start) // driven if step.kind is StepKind.DRIVE and driven else 0
            )
            picks = where_they_bend(self.time[part], curves, max(samples_per_step, share))
            kept.append(step.start + picks)
            new_steps.append(replace(step, start=count, stop=count + len(picks)))
            count += len(picks)
        index = np.concatenate(kept)
        thinned = self.picked(index, tuple(new_steps) if self.steps else ())
        return replace(thinned, cycle_table=self.cycle_table)

    def changed(self, time: FloatArray | None = None, **signals: FloatArray) -> Trajectory:
        """A copy with another time or other signals, by name."""
        return Trajectory(
            self.time if time is None else time,
            steps=self.steps,
            signals={**self.signals, **signals},
            cycle_table=self.cycle_table,
            inserted=self.inserted,
        )

    def picked(self, places: Places, steps: tuple[Step, ...]) -> Trajectory:
        """A copy of some of the samples, cut into these steps."""
        signals = {name: values[places] for name, values in self.signals.items()}
        return Trajectory(self.time[places], steps=steps, signals=signals, inserted=self.inserted[places])


def drawn_between(time: FloatArray, current: FloatArray) -> FloatArray:
    """Charge drawn between neighbouring samples, A.s, shape (n - 1,), if the current is linear in time between them."""
    return 0.5 * (current[1:] + current[:-1]) * np.diff(time)


def with_offset(current: FloatArray, offset_a: float) -> FloatArray:
    """A current with an offset of the instrument wherever one passes: a cell at rest is disconnected; shape (n,), A."""
    return np.where(current == 0.0, 0.0, current + offset_a)
