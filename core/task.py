"""What is to be matched: a cell model, the parameters to search, and the records to explain."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from .cell import CELL, FREQUENCY, SPECTRUM
from .domain import Domain
from .errors import BsaError
from .parameters import ParameterSpace
from .signals import Signal, compared, driven, observed
from .trajectory import Trajectory

Protocol = tuple[tuple[str, ...], ...]
"""Cycles of PyBaMM step strings, ``(("Charge at 1C until 4.2 V", "Rest for 1 hour"), ...)``."""


@dataclass(frozen=True)
class ParameterFile:
    """A parameter set from a file, whole: a journal must not depend on what lies elsewhere.

    Attributes
    ----------
    name : str
        What it is called. Untrusted.
    kind : {'bpx', 'parameter-values', 'calibrated'}
        How ``text`` is read: the Battery Parameter eXchange standard, PyBaMM's own JSON, or a calibrated cell model.
    text : str
        The content, JSON. Untrusted.
    """

    name: str
    kind: Literal["bpx", "parameter-values", "calibrated"]
    text: str

    def __str__(self) -> str:
        return self.name


Weight = Literal["uniform", "robust"]
"""How errors count: by their square, or large ones by their order of magnitude."""

NEAREST = "nearest"
"""In place of a parameter set, or of its open-circuit potentials: those that a slow record is nearest to."""

ParameterSource = str | ParameterFile
"""Where base parameters come from: the name of an installed set, or a file."""


@dataclass(frozen=True)
class CellModel:
    """Which equations and which base parameters.

    Attributes
    ----------
    parameter_set : str or ParameterFile
        Name of a PyBaMM parameter set, or a file's; empty for a simulator that has none.
    model : str
        The model's name: ``"SPM"``, ``"SPMe"`` or ``"DFN"`` for PyBaMM.
    options : mapping
        The model's options, ``{"thermal": "lumped"}``.
    overrides : mapping of str to float
        Values that replace those of the set and are not searched.
    effects : tuple of str
        Effects of the catalogue that the equations have too, by their keys.
    strengths : mapping of str to float
        Values of parameters of these effects that are not searched, by full name.
    offered : mapping of str to tuple of str
        Those of the effects that a search may leave out, with the names of their parameters, the strength first. They
        start absent: the strength has no effect where the search begins.
    """

    parameter_set: ParameterSource
    model: str = "DFN"
    options: Mapping[str, Any] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)
    offered: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Experiment:
    """One measured record and the way to simulate it.

    Attributes
    ----------
    name : str
        Where the record comes from.
    target : Trajectory
        What was measured, cut into steps; or an impedance spectrum as a record (`spectrum_record`).
    protocol : Protocol or None
        The steps that the simulator is to run; None drives it by what was measured of the driven signals
        (a cell by its current, with the voltage cut-offs widened; a spectrum is asked at its frequencies).
    scored_cycle : int or None
        The cycle on which the match is judged (the paper scores cycle 2); None for all of it.
    temperature_k : float or None
        Ambient temperature in kelvin, and that of the cell at the start; None keeps the parameter set's.
    initial_soc : float or None
        Initial state of charge, 0 to 1; None keeps the parameter set's initial concentrations
        (or the searched ``"Initial state of charge"``).
    initial_voltage : float or None
        Open-circuit voltage at the start, V: where ``initial_soc`` is None, each candidate starts at the state of
        charge at which its own cell shows it.
    detailed_cycles : tuple of int
        Of a long record the cycles whose curves are compared, each on its own clock; its other cycles count by the
        target's cycle table. Empty for a record that is compared whole.
    initial_temperature_k : float or None
        Temperature of the cell at the start in kelvin, where it is not the ambient one that ``temperature_k`` gives.
    """

    name: str
    target: Trajectory
    protocol: Protocol | None = None
    scored_cycle: int | None = None
    temperature_k: float | None = None
    initial_soc: float | None = None
    initial_voltage: float | None = None
    detailed_cycles: tuple[int, ...] = ()
    initial_temperature_k: float | None = None

    @property
    def long(self) -> bool:
        """Whether the record is a cycle table with the curves of a few cycles."""
        return bool(self.detailed_cycles)

    @property
    def is_spectrum(self) -> bool:
        """Whether the record is an impedance spectrum, whose clock counts decades of frequency (`spectrum_record`)."""
        return FREQUENCY.name in self.target.signals

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
    domain : Domain
        The wording of the task's field; by default that of a lithium-ion cell.
    signals : tuple of Signal
        What is driven and what is observed; by default the domain's.
    simulator : str
        The simulator that the task is made for; empty leaves it to the scaffold.
    held_out : tuple of Experiment
        Records that are not fitted; the best candidate is scored on them after the search.
    weight : {'uniform', 'robust'}
        How the errors of the signals count in a fit: ``"robust"`` keeps the knee at the end of a discharge, or
        whatever else is far off for a short time, from deciding it.
    """

    name: str
    cell: CellModel
    space: ParameterSpace
    experiments: tuple[Experiment, ...]
    notes: tuple[str, ...] = ()
    domain: Domain = CELL
    signals: tuple[Signal, ...] = ()
    simulator: str = ""
    held_out: tuple[Experiment, ...] = ()
    weight: Weight = "uniform"

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", self.signals or self.domain.signals)
        if self.weight not in get_args(Weight):
            raise BsaError(
                f'the weight of task "{self.name}" is "{self.weight}".', f"choose one of {', '.join(get_args(Weight))}."
            )
        if not self.experiments:
            raise BsaError(f'task "{self.name}" has no record to match.', "give it at least one experiment.")
        if not len(self.space):
            raise BsaError(f'task "{self.name}" searches no parameter.', "name at least one parameter to search.")
        if not observed(self.signals):
            raise BsaError(f'task "{self.name}" observes no signal.', 'give a signal the role "observed".')
        fitted = [experiment.name for experiment in self.experiments]
        both = [experiment.name for experiment in self.held_out if experiment.name in fitted]
        if both:
            raise BsaError(f'record "{both[0]}" of task "{self.name}" is fitted and held out.', "it can be only one.")
        for experiment in (*self.experiments, *self.held_out):
            lacking = [
                signal.name
                for signal in self.signals_of(experiment)
                if signal.name not in experiment.target.signals and (experiment.is_spectrum or not signal.optional)
            ]
            if lacking:
                raise BsaError(
                    f'record "{experiment.name}" of task "{self.name}" lacks the signals {lacking}.',
                    f"it has {list(experiment.target.signals)}.",
                )
            cycles = experiment.target.cycles
            if experiment.scored_cycle is not None and experiment.scored_cycle not in cycles:
                raise BsaError(
                    f'scored_cycle is {experiment.scored_cycle}, but record "{experiment.name}" has the cycles '
                    f"{list(cycles[:20])}.",
                    "choose one of them, or leave it out to match the whole record.",
                )
            self._check_long(experiment)

    def _check_long(self, experiment: Experiment) -> None:
        if experiment.long != self.long:
            raise BsaError(f'task "{self.name}" mixes records of whole lives with others.', "make a task of each kind.")
        if not experiment.long:
            return
        table, protocol = experiment.target.cycle_table, experiment.protocol
        lacking = sorted(set(experiment.detailed_cycles) - set(experiment.target.cycles))
        if lacking or table is None or protocol is None:
            raise BsaError(
                f'the long record "{experiment.name}" of task "{self.name}" lacks '
                + (f"the curves of the cycles {lacking}." if lacking else "its cycle table or its protocol."),
                "a long record has a protocol, a cycle table, and the curves of its detailed cycles.",
            )
        if max(table.cycle[-1], *experiment.detailed_cycles) > len(protocol):
            raise BsaError(
                f'the long record "{experiment.name}" has a cycle {table.cycle[-1]:.0f}, but its protocol has '
                f"{len(protocol)} cycles.",
                "write a protocol of all cycles.",
            )

    @property
    def long(self) -> bool:
        """Whether the records are those of ageing: cycle tables with the curves of a few cycles."""
        return self.experiments[0].long

    @property
    def given_drive(self) -> bool:
        """Whether measured driven signals drive every simulation, so that only what is observed can differ."""
        return all(experiment.protocol is None for experiment in self.experiments)

    def signals_of(self, experiment: Experiment) -> tuple[Signal, ...]:
        """The signals of an experiment's simulation: of a spectrum its own, of others those over time."""
        return SPECTRUM if experiment.is_spectrum else tuple(s for s in self.signals if s not in SPECTRUM)

    @property
    def observed(self) -> tuple[Signal, ...]:
        """The signals that the match is judged by."""
        return observed(self.signals)

    def observed_in(self, record: Trajectory) -> tuple[Signal, ...]:
        """Those of the observed signals that a record has; of a spectrum its own, though the task fits none."""
        own = tuple(signal for signal in self.observed if signal.name in record.signals)
        return own or tuple(signal for signal in observed(SPECTRUM) if signal.name in record.signals)

    @property
    def driven(self) -> tuple[Signal, ...]:
        """The signals that the experiments impose."""
        return driven(self.signals)

    def compared(self, kind: str, experiment: Experiment) -> tuple[Signal, ...]:
        """The signals that are compared in a step of an experiment."""
        wanted = compared(self.signals, kind, by_protocol=experiment.protocol is not None)
        return tuple(signal for signal in wanted if signal.name in experiment.target.signals)
