"""Time, current and voltage of a cell, cut into the steps a cycler would name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from .errors import BsaError

FloatArray = NDArray[np.float64]

SECONDS_PER_HOUR = 3600.0


class StepKind(StrEnum):
    """What the cycler was doing during a step."""

    REST = "rest"
    CC_CHARGE = "CC charge"
    CV_HOLD = "CV hold"
    CC_DISCHARGE = "CC discharge"
    PULSE = "pulse"
    DRIVE = "drive"


@dataclass(frozen=True)
class Step:
    """One step of a trajectory: the samples ``start`` to ``stop - 1``.

    Attributes
    ----------
    kind : StepKind
        What the cycler was doing.
    start, stop : int
        First sample, and one past the last sample.
    cycle : int
        Cycle the step belongs to, counted from 1.
    label : str
        The step in the words of the protocol, if there is one.
    position : int
        Place of the step in its cycle, from 0. Gaps mean that the protocol's step was skipped.
    """

    kind: StepKind
    start: int
    stop: int
    cycle: int = 1
    label: str = ""
    position: int = 0


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A simulated or measured record of one cell.

    Attributes
    ----------
    time : ndarray of shape (n,)
        Seconds, never decreasing. Two samples may share a stamp where one step ends and the next begins.
    current : ndarray of shape (n,)
        Ampere, **positive on discharge** (the convention of PyBaMM).
    voltage : ndarray of shape (n,)
        Volt.
    temperature : ndarray of shape (n,) or None
        Kelvin, where known.
    steps : tuple of Step
        Consecutive steps that cover all samples; empty where the record has not been cut yet.
    """

    time: FloatArray
    current: FloatArray
    voltage: FloatArray
    temperature: FloatArray | None = None
    steps: tuple[Step, ...] = field(default=())

    def __post_init__(self) -> None:
        for name in ("time", "current", "voltage", "temperature"):
            values = getattr(self, name)
            if values is None:
                continue
            values = np.asarray(values, dtype=np.float64)
            object.__setattr__(self, name, values)
            if values.shape != np.shape(self.time) or values.ndim != 1:
                raise BsaError(
                    f"{name} has shape {values.shape}, but time has shape {np.shape(self.time)}.",
                    "all signals of a trajectory share one time axis of shape (n,).",
                )
            if not np.all(np.isfinite(values)):
                row = int(np.flatnonzero(~np.isfinite(values))[0])
                raise BsaError(f"{name} is {values[row]} at sample {row}.", "remove or repair the sample.")
        if len(self.time) > 1 and np.any(np.diff(self.time) < 0):
            row = int(np.flatnonzero(np.diff(self.time) < 0)[0]) + 1
            raise BsaError(
                f"time runs backwards at sample {row} ({self.time[row - 1]:g} s, then {self.time[row]:g} s).",
                "sort the record, or cut it where the clock restarts.",
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    @property
    def discharge_capacity(self) -> FloatArray:
        """Charge drawn since the first sample in A.h, shape (n,); falls during charge."""
        increments = 0.5 * (self.current[1:] + self.current[:-1]) * np.diff(self.time)
        return np.concatenate([[0.0], np.cumsum(increments)]) / SECONDS_PER_HOUR

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
        temperature = None if self.temperature is None else self.temperature[start:stop]
        return Trajectory(self.time[start:stop], self.current[start:stop], self.voltage[start:stop], temperature, steps)

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

    def thinned(self, samples_per_step: int) -> Trajectory:
        """A copy of at most ``samples_per_step`` samples a step, ends kept; for storing and drawing."""
        steps = self.steps or (Step(StepKind.DRIVE, 0, len(self)),)
        kept: list[NDArray[np.intp]] = []
        new_steps: list[Step] = []
        count = 0
        for step in steps:
            size = step.stop - step.start
            picks = np.unique(np.linspace(0, size - 1, min(size, samples_per_step)).round().astype(np.intp))
            kept.append(step.start + picks)
            new_steps.append(replace(step, start=count, stop=count + len(picks)))
            count += len(picks)
        index = np.concatenate(kept)
        temperature = None if self.temperature is None else self.temperature[index]
        return Trajectory(
            self.time[index],
            self.current[index],
            self.voltage[index],
            temperature,
            tuple(new_steps) if self.steps else (),
        )
