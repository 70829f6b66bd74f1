"""What the engine needs from a simulator, and nothing more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..effect import Effect
from ..parameters import Candidate
from ..target import soc_name
from ..trajectory import FloatArray, Trajectory


@dataclass(frozen=True, eq=False)
class Specimen:
    """One record as the laboratory runs it.

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
        V.
    temperature : ndarray of shape (n,) or None
        K, where the model knows it.
    """

    voltage: FloatArray
    temperature: FloatArray | None = None


class Laboratory(Protocol):
    """Simulates a specimen on the base model with effects added, driven by its measured current."""

    def predict(
        self,
        effects: Sequence[Effect],
        candidate: Candidate,
        specimen: Specimen,
        times: FloatArray,
        current: FloatArray,
        fine: bool = False,
        soc: float | None = None,
    ) -> Prediction | None:
        """Predict voltage and temperature.

        Parameters
        ----------
        effects : sequence of Effect
            What is added to the base model.
        candidate : mapping of str to float
            Base parameters and the effects' parameters; what else it holds is left out.
        specimen : Specimen
            What is driven.
        times, current : ndarray of shape (n,)
            When, on the record's clock (s), and the measured current then (A, positive on discharge).
        fine : bool
            Whether to use the finer mesh and tighter tolerances, from which the error of the usual ones is known.
        soc : float or None
            State of charge at which the record starts, 0 to 1; None keeps the parameter set's.

        Returns
        -------
        Prediction or None
            None if the simulation failed.
        """
        ...
