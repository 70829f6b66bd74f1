"""A third-party plugin: a simulator whose cell is solved on paper, in microseconds.

The open-circuit voltage falls linearly with the charge drawn; behind it lie a series resistance and one
resistor-capacitor pair. The record is a rest, a constant-current discharge to a cut-off, and a rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from bsa.core.hooks import Entry, RunContext, hookimpl
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.scaffold import Scaffold, load_scaffold
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
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


def record(candidate: Candidate) -> Trajectory:
    """The cell's record: rest 60 s, discharge at 1 A to 3.2 V, rest 600 s; current positive on discharge."""
    capacity, series = candidate[CAPACITY], candidate[SERIES]
    polarisation, relaxation = candidate[POLARISATION], candidate[RELAXATION]
    slope = (FULL_V - EMPTY_V) / (3600.0 * capacity)

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
    current = np.concatenate([[0.0, 0.0], np.full(200, CURRENT_A), np.zeros(60)])
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


def toy_task(hidden: Candidate | None = None, name: str = "toy") -> Task:
    """A task whose target is the record of a cell with hidden values."""
    protocol = (("Rest for 60 seconds", "Discharge at 1 A until 3.2 V", "Rest for 600 seconds"),)
    experiment = Experiment("toy record", record(hidden or HIDDEN), protocol)
    return Task(name, CellModel("toy"), space(), (experiment,))


def toy_scaffold(name: str = "full", **changes: Any) -> Scaffold:
    """A built-in scaffold on the toy simulator."""
    content = {**load_scaffold(name).model_dump(), "simulator": "toy-cell", **changes}
    return Scaffold.model_validate(content)


class ToyCell:
    """The simulator."""

    def __init__(self, options: ToyOptions, context: RunContext) -> None:
        self._breaks_above = options.breaks_above_ohm

    @hookimpl
    def simulate(
        self, candidates: Sequence[Candidate], exact: bool, report: Callable[[int, Outcome], None]
    ) -> list[Outcome]:
        """See `RunHooks.simulate`."""
        outcomes = [self._simulate(candidate) for candidate in candidates]
        for number, outcome in enumerate(outcomes):
            report(number, outcome)
        return outcomes

    def _simulate(self, candidate: Candidate) -> Outcome:
        whole = record(candidate)
        if candidate[SERIES] <= self._breaks_above:
            return Outcome((ExperimentRun(whole),), 1e-4)
        failure = SimulationFailure("the toy solver gave up", "Discharge at 1 A until 3.2 V", 1, 60.0)
        return Outcome((ExperimentRun(whole.slice(0, 2), failure),), 1e-4)


@hookimpl
def bsa_simulators() -> Iterable[Entry]:
    """The toy."""
    yield Entry("toy-cell", ToyCell, "A cell with four parameters, solved on paper.", ToyOptions)
