"""What is asked of a simulator that adds effects to a model, and what it answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..effect import Effect
from ..parameters import Candidate
from ..target import current_offset_name, soc_name
from ..trajectory import FloatArray, StepKind, Trajectory

_MANY = 6
"""Cycles from which a record may show a cell that ages."""


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """One record as the simulator runs it."""

    name: str  # Unique among the records of a discovery.
    record: Trajectory  # Cut into steps; supplies the current.
    ambient_k: float | None = None  # Ambient temperature, K; None keeps the parameter set's.
    initial_k: float | None = None  # Of the cell at the start, K; None for the ambient one.

    @property
    def soc_name(self) -> str:
        """The fitted parameter that is this record's initial state of charge."""
        return soc_name(self.name)

    @property
    def offset_name(self) -> str:
        """The fitted parameter that is added to this record's current."""
        return current_offset_name(self.name)

    @property
    def own_names(self) -> tuple[str, str]:
        """The fitted parameters that act on this record alone."""
        return self.soc_name, self.offset_name

    @property
    def full_cycles(self) -> int:
        """Cycles that contain both a charge and a discharge of some length; pulses and drives make no cycle."""
        kinds: dict[int, set[str]] = {}
        for step in self.record.steps:
            kinds.setdefault(step.cycle, set()).add(step.kind)
        both = {StepKind.CC_CHARGE, StepKind.CC_DISCHARGE}
        return sum(both <= found for found in kinds.values())

    @property
    def is_long(self) -> bool:
        """Whether the record has so many cycles that the cell may have aged on the way."""
        return self.full_cycles >= _MANY


@dataclass(frozen=True, eq=False)
class Prediction:
    """What an augmented model says the instruments would show."""

    voltage: FloatArray  # Averages over the stretches of a record, V; shape (n,).
    temperature: FloatArray | None = None  # K, where the model knows it; shape (n,).


@dataclass(frozen=True, eq=False)
class Moments:
    """When a simulation is looked at to be averaged as a record is; shapes are (m,).

    Where the voltage bends, that at the middle of a stretch is not its mean.
    """

    # time, current: When, s, and the measured current then, A.
    time: FloatArray
    current: FloatArray
    share: FloatArray  # Of the stretch's samples, those that the moment stands for; adds up to 1 over a stretch.
    stretch: NDArray[np.intp]  # The stretch it belongs to, from 0 without gaps.

    @classmethod
    def single(cls, time: FloatArray, current: FloatArray) -> Moments:
        """One moment for each stretch."""
        return cls(time, current, np.ones(len(time)), np.arange(len(time)))

    def averaged(self, values: FloatArray) -> FloatArray:
        """What was simulated at the moments, shape (m,), averaged over each stretch, shape (n,)."""
        return np.asarray(np.bincount(self.stretch, self.share * values), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Request:
    """One simulation: a measured record on the base model with effects added, driven by its measured current."""

    effects: tuple[Effect, ...]  # What is added to the base model.
    candidate: Candidate  # Base parameters and the effects' parameters; what else it holds is left out.
    measured_record: MeasuredRecord
    moments: Moments  # When voltage and temperature are wanted, and how they are averaged.
    # Whether to use the finer mesh and tighter tolerances, from which the error of the usual ones is known.
    fine: bool = False
    soc: float | None = None  # State of charge at which the record starts, 0 to 1; None keeps the parameter set's.
    offset: float = 0.0  # What is added to the measured current, A.
    # Whether the simulator's cheaper model is to answer; see `Answering.has_low_fidelity`.
    low_fidelity: bool = False

    @property
    def identity(self) -> dict[str, Any]:
        """What tells it from every other request of the same discovery."""
        told: dict[str, Any] = {
            "effects": [effect.key for effect in self.effects],
            "candidate": {name: float(value) for name, value in self.candidate.items()},
            "record": [self.measured_record.name, len(self.measured_record.record)],
            "moments": [len(self.moments.time), float(self.moments.time.sum())],
            "fine": self.fine,
            "soc": None if self.soc is None else float(self.soc),
        }
        if self.offset:
            told["offset"] = float(self.offset)
        return told | ({"low_fidelity": True} if self.low_fidelity else {})


@dataclass(frozen=True, eq=False)
class LifeRequest:
    """One simulation of a cell's life, or of one of its cycles, with effects added."""

    effects: tuple[Effect, ...]
    candidate: Candidate  # The cell's own parameters and the effects' parameters.
    cycle: int | None = None  # A cycle whose curves are kept, alone; None for the whole life.

    @property
    def identity(self) -> dict[str, Any]:
        """As of `Request`."""
        return {
            "effects": [effect.key for effect in self.effects],
            "candidate": {name: float(value) for name, value in self.candidate.items()},
            "cycle": self.cycle,
        }


@dataclass(frozen=True, eq=False)
class LifeResiduals:
    """How far a simulated life is from the measured one."""

    residual: FloatArray  # In tolerances, as `residuals` gives them; shape (m,).


AnyRequest = TypeVar("AnyRequest", Request, LifeRequest)
Asked = TypeVar("Asked", contravariant=True)
Given = TypeVar("Given", covariant=True)


class Answering(Protocol[Asked, Given]):
    """Simulates; several requests at once may run side by side."""

    # Whether there is a cheaper model with the same parameters, whose derivatives are nearly those of the base model.
    has_low_fidelity: bool
    at_once: int  # How many requests run side by side; threads may share a simulator with more than one.
    simulations: int  # Requests answered.
    recalled: int  # How many of them without a simulation, from a journal.
    refused: dict[str, str]  # Effects that could not be built, and why.

    def predict(self, requests: Sequence[Asked]) -> Sequence[Given | None]:
        """Answer each request, in order; None where the simulation failed."""
        ...


Simulator = Answering[Request, Prediction]
"""Predicts voltage and temperature of measured records."""
