"""What the engine needs from a simulator, and nothing more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..effect import Effect
from ..parameters import Candidate
from ..target import soc_name
from ..trajectory import FloatArray, Trajectory


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """One record as the simulator runs it.

    Attributes
    ----------
    name : str
        Unique among the records of a discovery.
    record : Trajectory
        Cut into steps; supplies the current.
    ambient_k : float or None
        Ambient and initial temperature, K; None keeps the parameter set's.
    """

    name: str
    record: Trajectory
    ambient_k: float | None = None

    @property
    def soc_name(self) -> str:
        """The fitted parameter that is this record's initial state of charge."""
        return soc_name(self.name)


@dataclass(frozen=True, eq=False)
class Prediction:
    """What an augmented model says the instruments would show.

    Attributes
    ----------
    voltage : ndarray of shape (n,)
        Averages over the stretches of a record, V.
    temperature : ndarray of shape (n,) or None
        K, where the model knows it.
    """

    voltage: FloatArray
    temperature: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Moments:
    """When a simulation is looked at to be averaged as a record is; shapes are (m,).

    A simulated voltage at the middle of a stretch is not its mean where the voltage bends: over a quarter of an hour
    before a cell is empty the two are 40 mV apart.

    Attributes
    ----------
    time, current : ndarray
        When, s, and the measured current then, A.
    share : ndarray
        Of the stretch's samples, those that the moment stands for; adds up to 1 over a stretch.
    stretch : ndarray of int
        The stretch it belongs to, from 0 without gaps.
    """

    time: FloatArray
    current: FloatArray
    share: FloatArray
    stretch: NDArray[np.intp]

    @classmethod
    def single(cls, time: FloatArray, current: FloatArray) -> Moments:
        """One moment for each stretch."""
        return cls(time, current, np.ones(len(time)), np.arange(len(time)))

    def averaged(self, values: FloatArray) -> FloatArray:
        """What was simulated at the moments, shape (m,), averaged over each stretch, shape (n,)."""
        return np.asarray(np.bincount(self.stretch, self.share * values), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Request:
    """One simulation: a measured record on the base model with effects added, driven by its measured current.

    Attributes
    ----------
    effects : tuple of Effect
        What is added to the base model.
    candidate : mapping of str to float
        Base parameters and the effects' parameters; what else it holds is left out.
    measured_record : MeasuredRecord
        What is driven.
    moments : Moments
        When voltage and temperature are wanted, and how they are averaged.
    fine : bool
        Whether to use the finer mesh and tighter tolerances, from which the error of the usual ones is known.
    soc : float or None
        State of charge at which the record starts, 0 to 1; None keeps the parameter set's.
    low_fidelity : bool
        Whether the simulator's cheaper model is to answer; see `Simulator.has_low_fidelity`.
    """

    effects: tuple[Effect, ...]
    candidate: Candidate
    measured_record: MeasuredRecord
    moments: Moments
    fine: bool = False
    soc: float | None = None
    low_fidelity: bool = False


class Simulator(Protocol):
    """Simulates; several requests at once may run side by side.

    Attributes
    ----------
    at_once : int
        How many requests run side by side; threads may share a simulator with more than one.
    simulations : int
        Requests answered.
    recalled : int
        How many of them without a simulation, from a journal.
    refused : dict of str to str
        Effects that could not be built, and why.
    has_low_fidelity : bool
        Whether there is a cheaper model with the same parameters, whose derivatives are nearly those of the base model.
    """

    has_low_fidelity: bool
    at_once: int
    simulations: int
    recalled: int
    refused: dict[str, str]

    def predict(self, requests: Sequence[Request]) -> list[Prediction | None]:
        """Predict voltage and temperature for each request, in order; None where the simulation failed."""
        ...
