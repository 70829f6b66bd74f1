"""What the engine needs from a simulator, and nothing more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..effect import Effect
from ..parameters import Candidate
from ..trajectory import FloatArray, Trajectory

INITIAL_SOC = "Initial state of charge"
"""Name of the initial state of charge of one record; the fit has one for each, ``"Initial state of charge: NAME"``."""


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
        return f"{INITIAL_SOC}: {self.name}"


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
    ) -> Prediction | None:
        """Predict voltage and temperature.

        Parameters
        ----------
        effects : sequence of Effect
            What is added to the base model.
        candidate : mapping of str to float
            Base parameters, ``"Initial state of charge"`` and the effects' parameters.
        specimen : Specimen
            What is driven.
        times, current : ndarray of shape (n,)
            When, on the record's clock (s), and the measured current then (A, positive on discharge).
        fine : bool
            Whether to use the finer mesh and tighter tolerances, from which the error of the usual ones is known.

        Returns
        -------
        Prediction or None
            None if the simulation failed.
        """
        ...
