"""What is to be matched: a cell model, the parameters to search, and the records to explain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import BsaError
from .parameters import ParameterSpace
from .trajectory import Trajectory

Protocol = tuple[tuple[str, ...], ...]
"""Cycles of PyBaMM step strings, ``(("Charge at 1C until 4.2 V", "Rest for 1 hour"), ...)``."""


@dataclass(frozen=True)
class CellModel:
    """Which equations and which base parameters.

    Attributes
    ----------
    model : {'SPM', 'SPMe', 'DFN'}
        The model's name.
    options : mapping
        PyBaMM model options, ``{"thermal": "lumped"}``.
    parameter_set : str
        Name of a PyBaMM parameter set.
    overrides : mapping of str to float
        Values that replace those of the set and are not searched.
    """

    parameter_set: str
    model: str = "DFN"
    options: Mapping[str, Any] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Experiment:
    """One measured record and the way to simulate it.

    Attributes
    ----------
    name : str
        Where the record comes from.
    target : Trajectory
        What was measured, cut into steps.
    protocol : Protocol or None
        The steps that the simulator is to run; None drives it by the measured current, with the
        voltage cut-offs widened.
    scored_cycle : int or None
        The cycle on which the match is judged (the paper scores cycle 2); None for all of it.
    temperature_k : float or None
        Ambient and initial temperature in kelvin; None keeps the parameter set's.
    initial_soc : float or None
        Initial state of charge, 0 to 1; None keeps the parameter set's initial concentrations
        (or the searched ``"Initial state of charge"``).
    """

    name: str
    target: Trajectory
    protocol: Protocol | None = None
    scored_cycle: int | None = None
    temperature_k: float | None = None
    initial_soc: float | None = None

    @property
    def scored_target(self) -> Trajectory:
        """The part of the target on which the match is judged."""
        return self.target if self.scored_cycle is None else self.target.cycle(self.scored_cycle)


@dataclass(frozen=True)
class Task:
    """A calibration problem.

    Attributes
    ----------
    name : str
        Short name, used for the run's folder.
    cell : CellModel
        The model to calibrate.
    space : ParameterSpace
        The parameters to search.
    experiments : tuple of Experiment
        The records to match, at least one.
    notes : tuple of str
        What was assumed or repaired while the task was put together; shown to the user.
    """

    name: str
    cell: CellModel
    space: ParameterSpace
    experiments: tuple[Experiment, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.experiments:
            raise BsaError(f'task "{self.name}" has no record to match.', "give it at least one experiment.")
        if not len(self.space):
            raise BsaError(f'task "{self.name}" searches no parameter.', "name at least one parameter to search.")
