"""The low-fidelity model of a DFN: near the search's own, cheaper, and absent where nothing is gained."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.hooks import RunContext
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import Outcome, in_order
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.modelling.resolution import DRIVEN_LOW_FIDELITY, LOW_FIDELITY
from bsa.plugins.pybamm.simulators.simulator import PyBaMMOptions, PyBaMMSimulator
from bsa.plugins.pybamm.solving.experiment_kinds import compiled, solve_reference

RADIUS = "Negative particle radius [m]"
SPACE = ParameterSpace((Parameter(RADIUS, 5.86e-6, 2e-6, 2e-5, "log"),))


def discharge(current_a: float = 5.0, seconds: float = 1800.0) -> Experiment:
    time = np.linspace(0.0, seconds, 181)
    step = (Step(StepKind.CC_DISCHARGE, 0, len(time)),)
    record = Trajectory(time, np.full(len(time), current_a), np.full(len(time), 3.7), None, step)
    return Experiment("record", record, initial_soc=1.0)


def task_of(cell: CellModel, experiment: Experiment) -> Task:
    return Task("t", cell, SPACE, (experiment,))


@contextmanager
def simulator_of(task: Task, folder: Path) -> Iterator[PyBaMMSimulator]:
    simulator = PyBaMMSimulator(PyBaMMOptions(), RunContext(task, 1, folder))
    try:
        yield simulator
    finally:
        simulator.close()


def voltage(outcome: Outcome) -> np.ndarray:
    (run,) = outcome.runs
    assert run.trajectory is not None
    return np.asarray(run.trajectory.voltage)


@pytest.mark.parametrize("model", ["SPM", "SPMe"])
def test_a_single_particle_model_has_none(model: str, tmp_path: Path) -> None:
    with simulator_of(task_of(CellModel("Chen2020", model), discharge()), tmp_path) as simulator:
        assert simulator.simulate_low_fidelity([]) is None


@pytest.mark.slow
def test_its_differences_are_those_of_the_search(tmp_path: Path) -> None:
    candidates = [SPACE.initial, {RADIUS: 6.0e-6}]
    with simulator_of(task_of(CellModel("Chen2020"), discharge()), tmp_path) as simulator:
        full = [voltage(outcome) for outcome in in_order(simulator.simulate(candidates, exact=False))]
        found = simulator.simulate_low_fidelity(candidates)
        assert found is not None
        low = [voltage(outcome) for outcome in in_order(found)]
    assert not np.array_equal(low[0], full[0])
    assert np.sqrt(np.mean((low[0] - full[0]) ** 2)) < 0.01
    slope, other = low[1] - low[0], full[1] - full[0]
    assert np.linalg.norm(slope - other) < 0.05 * np.linalg.norm(other)


@pytest.mark.slow
def test_it_is_a_dfn_on_fewer_points_and_on_fewest_under_a_measured_current() -> None:
    cell = CellModel("Chen2020")
    by_current = discharge(seconds=300.0)
    by_protocol = replace(by_current, protocol=(("Discharge at 1C for 5 minutes",),))
    for experiment, resolution in ((by_current, DRIVEN_LOW_FIDELITY), (by_protocol, LOW_FIDELITY)):
        run = compiled(cell, experiment, {}, LOW_FIDELITY).solve({})
        same = solve_reference(cell, experiment, CellChange(), resolution)
        assert run.trajectory is not None
        assert same.trajectory is not None
        assert run.trajectory.voltage[-1] == pytest.approx(same.trajectory.voltage[-1], abs=5e-5), resolution
    assert (DRIVEN_LOW_FIDELITY.points or 0) < (LOW_FIDELITY.points or 0)
