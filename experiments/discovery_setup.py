"""All that a discovery works with, set up from a case."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.contracts.effect_choice import effects_of
from ..core.contracts.evidence import gather
from ..core.contracts.requests import Simulator
from ..core.discovery.engine import Engine
from ..core.discovery.explanation import Explanation
from ..core.discovery.findings import Listener, Nomination, Settings
from ..core.discovery.localisation import in_words, localise
from ..core.effect import Effect
from ..core.inference.observations import Observations, observe
from ..core.inference.problem import Problem
from ..core.inference.reference import check_tests, without_known
from ..core.parameters import ParameterSpace
from ..core.rms import rms
from ..core.run.journal import Event, OpenJournal
from ..core.task import CellModel
from ..plugins.pybamm.augmentation import effects_in
from ..plugins.pybamm.before_search.radial_mesh import RadialMesh, radial_mesh
from ..plugins.pybamm.before_search.uncertain_parameters import uncertain_parameters
from ..plugins.pybamm.cells.parameter_sets import pybamm
from ..plugins.pybamm.cells.state_of_charge import equilibrium_capacity_ah
from ..plugins.pybamm.simulators.effect_simulator import EffectSimulator
from .discovery_case import Case, DiscoverOptions, spreads_of

SETTLED = "settled"

_KNOWN = 0.5
"""Standard deviation of an effect's strength that a run found, as a share of it, as wide as that of a diffusivity from
one simulator to the next."""


@dataclass(frozen=True)
class Settled:
    """What models of the cell, built before anything is fitted, have told."""

    spreads: Mapping[str, tuple[float, float, float]]  # What is uncertain, see `spreads_of`.
    mesh: RadialMesh  # How finely the particles are resolved.

    @classmethod
    def in_events(cls, events: Iterable[Event]) -> Settled | None:
        """What the journal of an earlier session tells; None where it does not."""
        for event in events:
            if event["event"] == SETTLED:
                shift_v = math.inf if event["shift_v"] is None else event["shift_v"]
                spreads = {name: (spread, lower, upper) for name, (spread, lower, upper) in event["spreads"].items()}
                return cls(spreads, RadialMesh(event["radial_points"], shift_v))
        return None

    @property
    def event(self) -> dict[str, Any]:
        """As a journal keeps it."""
        shift_v = self.mesh.shift_v if math.isfinite(self.mesh.shift_v) else None
        return {"spreads": dict(self.spreads), "radial_points": self.mesh.radial_points, "shift_v": shift_v}


@dataclass(frozen=True, eq=False)
class DiscoverySetup:
    """Records, simulator and catalogue."""

    case: Case  # What was asked.
    problem: Problem  # The records, condensed, and the simulator.
    space: ParameterSpace  # The uncertain parameters of the base model.
    catalogue: tuple[Effect, ...]  # What may be missing.
    simulator: Simulator  # The problem's, with what it refused to build.
    mesh: RadialMesh  # How finely the particles are resolved.
    capacity_ah: float  # Charge of the cell between its cut-offs at rest, which C-rates count in, A.h.
    settings: Settings  # How hard the engine looks.
    notes: tuple[str, ...]  # What was assumed, repaired or settled.

    def engine(
        self,
        listener: Listener = lambda text: None,
        preferred: Callable[[Explanation, Sequence[Nomination]], Sequence[str]] | None = None,
    ) -> Engine:
        """The workflow on it; see `Engine`."""
        cell = self.case.cell
        evidence = gather(cell.model, cell.options, [*self.case.measured_records, *self.case.held])
        return Engine(self.problem, self.space, self.catalogue, evidence, self.settings, listener, preferred)

    def discrepancy(self, base: Explanation) -> list[str] | None:
        """What a base model leaves, in words; None if it cannot be simulated."""
        problem = self.problem
        predictions = problem.predict((), base.fit.candidate)
        if predictions is None:
            return None
        places = localise(problem.observations, problem.errors(predictions), self.capacity_ah)
        return in_words(places, problem.noise_v)


def say_notes(notes: Sequence[str], listener: Listener) -> None:
    """Say what was assumed, repaired or settled as soon as it is known: a wrong unit shows in what it leads to."""
    for note in notes:
        listener(f"note: {note}")


MakeSimulator = Callable[[CellModel, ParameterSpace, RadialMesh], Simulator]


def in_this_process(cell: CellModel, space: ParameterSpace, mesh: RadialMesh) -> Simulator:
    """A simulator that simulates one request after the other, here."""
    return EffectSimulator(cell, space.targets, mesh.usual, mesh.fine)


def set_up(
    case: Case,
    options: DiscoverOptions,
    listener: Listener = lambda text: None,
    make_simulator: MakeSimulator = in_this_process,
    journal: OpenJournal | None = None,
) -> DiscoverySetup:
    """Settle the mesh, choose what is uncertain, and condense the records of a case.

    What is settled is written into the journal, and taken from there where the discovery is resumed: finding it out
    takes longer than reading the records.
    """
    pybamm.set_logging_level("CRITICAL")
    cell = case.cell
    passed_over: list[str] = []  # Effects that cannot be used, and why.
    # What is wrong with the options is said before anything else.
    catalogue = effects_of(options.effects, None, options.effect_options, passed_over.append)
    there = {effect.name for effect in effects_in(cell)}
    catalogue = tuple(effect for effect in catalogue if effect.name not in there)
    known = None if journal is None else Settled.in_events(journal.earlier)
    spreads = spreads_of(options.search, cell) if known is None else known.spreads
    say_notes([*case.notes, *passed_over], listener)
    records = [*case.measured_records, *case.held]
    floor = 1e-3 * options.floor_mv
    seen, earlier = ([observe(one, options.points, floor) for one in some] for some in (records, case.references))
    check_tests(seen, earlier)
    mesh = radial_mesh(cell, records, case.initial_soc) if known is None else known.mesh
    if journal is not None and known is None:
        journal.file.append(SETTLED, **Settled(spreads, mesh).event)
    of_mesh = [mesh.note] * bool(mesh.note)
    say_notes(of_mesh, listener)
    space = _with_strengths(uncertain_parameters(case.measured_records, case.initial_soc, spreads), case)
    simulator = make_simulator(cell, space, mesh)
    said: list[str] = []  # What references have taken off the records.
    if earlier:
        as_measured, seen = seen, without_known(simulator, seen, earlier, space.at(np.zeros(len(space))))
        said = [
            _taken_off(measured, left, earlier[place :: len(seen)])
            for place, (measured, left) in enumerate(zip(as_measured, seen, strict=True))
        ]
        say_notes(said, listener)
    count = len(case.measured_records)
    problem = Problem(simulator, seen[:count], seen[count:])
    capacity = equilibrium_capacity_ah(cell.parameter_set, cell.overrides)
    # What the base model lacks of references is taken off the records.
    settings = Settings(options.max_effects, options.seed, 0.0 if case.references else case.known_v)
    notes = (*case.notes, *of_mesh, *passed_over, *said)
    return DiscoverySetup(case, problem, space, catalogue, simulator, mesh, capacity, settings, notes)


def _taken_off(measured: Observations, left: Observations, references: Sequence[Observations]) -> str:
    """What is said of a record of which references have taken something off."""
    known_mv = 1e3 * rms(measured.voltage - left.voltage)
    unsure_mv = 1e3 * rms(np.linalg.norm(left.systematic, axis=1))
    differ = ", and how far the references differ" if len(references) > 1 else ""
    known = " and ".join(one.name for one in references)
    return (
        f"{measured.name}: what the base model lacks of {known}, {known_mv:.2g} mV (rms of averages), is taken off the "
        "voltage: what has changed since is to be explained. "
        f"{unsure_mv:.2g} mV of it are uncertain: a quarter{differ}."
    )


def _with_strengths(space: ParameterSpace, case: Case) -> ParameterSpace:
    """The base model's uncertain parameters, and those of the effects that it has, where a run found them."""
    found = []
    for parameter in (p for effect in effects_in(case.cell) for p in effect.searched):
        value = parameter.project(case.strengths.get(parameter.name, parameter.initial))
        deviation = max(_KNOWN * abs(value), parameter.length) if parameter.scale == "linear" else parameter.deviation
        found.append(replace(parameter, initial=value, prior=True, deviation=deviation))
    return ParameterSpace((*space, *found))
