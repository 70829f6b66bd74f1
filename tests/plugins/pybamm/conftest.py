"""Physics that several tests look at, simulated once a session."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.target import CellChange, target_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import FloatArray, Step, StepKind, Trajectory
from bsa.plugins.pybamm.modelling.resolution import REFERENCE
from bsa.plugins.pybamm.solving.compiled import CompiledExperiment
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

GEOMETRY = (
    "Negative particle radius [m]",
    "Negative electrode thickness [m]",
    "Positive electrode porosity",
    "Separator thickness [m]",
)
NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))


def short_experiment(soc: float | None = 0.5) -> Experiment:
    protocol = (("Discharge at 1C for 10 minutes", "Rest for 5 minutes", "Charge at 1C for 5 minutes"),)
    return Experiment("short", NOTHING, protocol, initial_soc=soc)


@pytest.fixture(scope="session")
def chen() -> CompiledExperiment:
    """A compiled DFN of Chen2020 with searched geometry, a factor and the state of charge."""
    searched = (*GEOMETRY, "Negative electrode exchange-current density [A.m-2] factor", "Initial state of charge")
    return CompiledExperiment(
        CellModel("Chen2020"), short_experiment(None), {key: target_named(key) for key in searched}
    )


@pytest.fixture(scope="session")
def measured() -> Trajectory:
    """A short record of the reference cell, its particles resolved: discharge, rest, charge; positive on discharge."""
    run = solve_reference(CellModel("Chen2020"), short_experiment(), CellChange(), REFERENCE.graded())
    assert run.trajectory is not None
    return run.trajectory


@pytest.fixture(scope="session")
def rest_then_discharge() -> Callable[[FloatArray, float, float], Trajectory]:
    """Makes a record on a clock, s: at rest until a time, s, then at a constant current, A."""

    def made(clock: FloatArray, rest_s: float, current_a: float) -> Trajectory:
        current = np.where(clock < rest_s, 0.0, current_a)
        begins = int(np.searchsorted(clock, rest_s))
        steps = (Step(StepKind.REST, 0, begins), Step(StepKind.CC_DISCHARGE, begins, len(clock)))
        return Trajectory(clock, current, np.full(len(clock), 3.8), None, steps)

    return made
