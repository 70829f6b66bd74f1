"""A third-party plugin: a simulator whose cell is solved on paper, in microseconds.

The open-circuit voltage falls linearly with the charge drawn; behind it lie a series resistance and one
resistor-capacitor pair. The record is a rest, a constant-current discharge to a cut-off, and a rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bsa.core.hooks import Entry, RunContext, hookimpl
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.scaffold import Scaffold, load_scaffold
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.task_reduction import TaskReduction
from bsa.core.trajectory import Step, StepKind, Trajectory
from pydantic import BaseModel, Field

CAPACITY = "Capacity [A.h]"
SERIES = "Series resistance [Ohm]"
POLARISATION = "Polarisation resistance [Ohm]"
RELAXATION = "Relaxation time [s]"

FULL_V, EMPTY_V, CUT_OFF_V, CURRENT_A = 4.2, 3.0, 3.2, 1.0
HIDDEN = {CAPACITY: 1.3, SERIES: 0.03, POLARISATION: 0.05, RELAXATION: 200.0}


class ToyOptions(BaseModel, extra="forbid"):
    """How the toy misbehaves, for tests of what follows."""

    breaks_above_ohm: float = Field(1.0, description="Series resistance above which the solver gives up.")
    low_fidelity: bool = Field(
        False, description="Whether it has a low-fidelity model, which relaxes a little too fast."
    )


def record(candidate: Candidate, current_a: float = CURRENT_A) -> Trajectory:
    """The cell's record: rest 60 s, discharge to 3.2 V, rest 600 s; current positive on discharge."""
    capacity, series = candidate[CAPACITY], current_a * candidate[SERIES]
    polarisation, relaxation = current_a * candidate[POLARISATION], candidate[RELAXATION]
    slope = current_a * (FULL_V - EMPTY_V) / (3600.0 * capacity)

    def loaded(t: np.ndarray) -> np.ndarray:
        return FULL_V - slope * t - series - polarisation * (1.0 - np.exp(-t / relaxation))

    end = max((FULL_V - series - polarisation - CUT_OFF_V) / slope, 2.0)
    for _ in range(20):  # Newton's method for the time of the cut-off
        rate = -slope - polarisation / relaxation * np.exp(-end / relaxation)
        end -= float((loaded(np.array(end)) - CUT_OFF_V) / rate)
    discharge, after = np.linspace(0.0, end, 200), np.linspace(0.0, 600.0, 60)
    rested = FULL_V - slope * end
    tail = rested - polarisation * (1 - np.exp(-end / relaxation)) * np.exp(-after / relaxation)
    time = np.concatenate([[0.0, 60.0], 60.0 + discharge, 60.0 + end + after])
    current = np.concatenate([[0.0, 0.0], np.full(200, current_a), np.zeros(60)])
    voltage = np.concatenate([[FULL_V, FULL_V], loaded(discharge), tail])
    steps = (
        Step(StepKind.REST, 0, 2, position=0),
        Step(StepKind.CC_DISCHARGE, 2, 202, position=1),
        Step(StepKind.REST, 202, 262, position=2),
    )
    return Trajectory(time, current, voltage, None, steps)


def space() -> ParameterSpace:
    """Four parameters, started away from the hidden values."""
    return ParameterSpace(
        (
            Parameter(CAPACITY, 1.0, 0.5, 3.0, "log"),
            Parameter(SERIES, 0.05, 0.005, 0.5, "log"),
            Parameter(POLARISATION, 0.03, 0.005, 0.5, "log"),
            Parameter(RELAXATION, 100.0, 20.0, 1000.0, "log"),
        )
    )


def toy_task(hidden: Candidate | None = None, name: str = "toy", simulator: str = "") -> Task:
    """A task whose target is the record of a cell with hidden values."""
    protocol = (("Rest for 60 seconds", "Discharge at 1 A until 3.2 V", "Rest for 600 seconds"),)
    experiment = Experiment("toy record", record(hidden or HIDDEN), protocol)
    return Task(name, CellModel("toy"), space(), (experiment,), simulator=simulator)


def toy_scaffold(name: str = "full", **changes: Any) -> Scaffold:
    """A built-in scaffold on the toy simulator."""
    content = {**load_scaffold(name).model_dump(), "simulator": "toy-cell", **changes}
    return Scaffold.model_validate(content)


class ToyCell:
    """The simulator."""

    def __init__(self, options: ToyOptions, context: RunContext) -> None:
        self._breaks_above, self._low_fidelity = options.breaks_above_ohm, options.low_fidelity
        self._experiment = context.task.experiments[0]
        self._reduced: dict[TaskReduction, tuple[Experiment, ...]] = {}

    @hookimpl
    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        for place, candidate in enumerate(candidates):
            run = self._run(candidate, CURRENT_A)
            if run.trajectory is not None and self._experiment.protocol is None:
                run = replace(run, trajectory=lasting(run.trajectory, self._experiment.target.duration))
            yield place, Outcome((run,), 1e-4)

    @hookimpl
    def simulate_low_fidelity(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_low_fidelity`; it relaxes a little too fast."""
        if not self._low_fidelity:
            return None
        hasty = [{**candidate, RELAXATION: 0.9 * candidate[RELAXATION]} for candidate in candidates]
        return self.simulate(hasty, exact=False)

    @hookimpl
    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...]
    ) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate_variant`; the discharge's current is read from the protocol."""
        for place, candidate in enumerate(candidates):
            yield place, Outcome(tuple(self._run(candidate, discharge_a(e)) for e in experiments), 1e-4)

    @hookimpl
    def reduce_task(self, reduction: TaskReduction) -> tuple[Experiment, ...]:
        """See `RunHooks.reduce_task`; the toy has a single cycle, so only its current can be lowered."""
        amperes = CURRENT_A * reduction.rate
        protocol = (("Rest for 60 seconds", f"Discharge at {amperes:g} A until 3.2 V", "Rest for 600 seconds"),)
        return self._reduced.setdefault(reduction, (replace(self._experiment, protocol=protocol),))

    @hookimpl
    def next_protocols(self) -> dict[str, tuple[tuple[str, ...], ...]]:
        """See `RunHooks.next_protocols`."""
        return {
            f"discharge at {amperes:g} A": (
                ("Rest for 60 seconds", f"Discharge at {amperes:g} A until 3.2 V", "Rest for 600 seconds"),
            )
            for amperes in (0.1, 1.0, 4.0)
        }

    def _run(self, candidate: Candidate, current_a: float) -> ExperimentRun:
        whole = record(candidate, current_a)
        if candidate[SERIES] * current_a <= self._breaks_above * CURRENT_A:
            return ExperimentRun(whole)
        failure = SimulationFailure("the toy solver gave up", "Discharge at 1 A until 3.2 V", 1, 60.0)
        return ExperimentRun(whole.slice(0, 2), failure)


def lasting(simulated: Trajectory, duration_s: float) -> Trajectory:
    """The same, at rest until its record ends."""
    if simulated.duration >= duration_s:
        return simulated
    *steps, last = simulated.steps
    return Trajectory(
        np.append(simulated.time, duration_s),
        np.append(simulated.current, 0.0),
        np.append(simulated.voltage, simulated.voltage[-1]),
        steps=(*steps, replace(last, stop=last.stop + 1)),
    )


def discharge_a(experiment: Experiment) -> float:
    """The current of an experiment's discharge, A."""
    assert experiment.protocol is not None
    return float(experiment.protocol[0][1].split()[2])


@hookimpl
def bsa_simulators() -> Iterable[Entry]:
    """The toy."""
    yield Entry("toy-cell", ToyCell, "A cell with four parameters, solved on paper.", ToyOptions, api=1)
