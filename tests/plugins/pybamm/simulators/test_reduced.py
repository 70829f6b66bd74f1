"""Eased protocols, and what a failed step shows of its end."""

from pathlib import Path

import numpy as np
import pytest
from bsa.core.hooks import RunContext
from bsa.core.parameters import ParameterSpace
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.task_reduction import TaskReduction
from bsa.core.trajectory import StepKind, Trajectory
from bsa.experiments.suite.case import MODEL_OPTIONS, protocol
from bsa.plugins.pybamm.before_search.presets import preset_space
from bsa.plugins.pybamm.simulators.reduced import reduced, slowed
from bsa.plugins.pybamm.simulators.simulator import PyBaMMOptions, PyBaMMSimulator
from bsa.plugins.pybamm.solving.compiled import CompiledExperiment

NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize(
    ("step", "half"),
    [
        ("Charge at 2C until 4.2 V", "Charge at 1C until 4.2 V"),
        ("Discharge at 0.2C until 2.5 V", "Discharge at 0.1C until 2.5 V"),
        ("Discharge at C/5 until 2.5 V", "Discharge at 0.1C until 2.5 V"),
        ("Discharge at 5 A until 2.5 V", "Discharge at 2.5 A until 2.5 V"),
        ("Charge at 500 mA until 4.1 V", "Charge at 250 mA until 4.1 V"),
        ("Charge at 5e-05 A until 4.1 V", "Charge at 2.5e-05 A until 4.1 V"),
        ("Hold at 4.2 V until C/20", "Hold at 4.2 V until C/20"),
        ("Rest for 1 hour", "Rest for 1 hour"),
        ("Discharge at 1C for 10 minutes", "Discharge at 1C for 10 minutes"),
    ],
)
def test_currents_are_halved_and_nothing_else(step: str, half: str) -> None:
    assert slowed(step, 0.5) == half


def test_a_measured_current_keeps_its_charge() -> None:
    record = Trajectory(np.array([0.0, 10.0, 20.0]), np.array([2.0, 2.0, 2.0]), np.array([4.0, 3.9, 3.8]))
    slow = reduced(Experiment("r", record), TaskReduction(0.5)).target
    assert slow.duration == 40.0
    assert slow.discharge_capacity[-1] == pytest.approx(record.discharge_capacity[-1])


def starved() -> tuple[ParameterSpace, dict[str, float]]:
    """A cell of Ecker2015 whose electrolyte runs out of salt at 2C."""
    space = preset_space("Ecker2015", "geometry")
    rng = np.random.default_rng(1)
    return space, [space.sample(rng) for _ in range(36)][35]


@pytest.mark.slow
def test_a_step_that_dies_shows_its_last_moments_and_the_limit() -> None:
    space, candidate = starved()
    experiment = Experiment("x", NOTHING, protocol(2, 2, 4.2, 2.5))
    run = CompiledExperiment(CellModel("Ecker2015", "DFN", MODEL_OPTIONS), experiment, space.targets).solve(candidate)
    assert run.failure is not None
    assert run.trajectory is not None
    assert "the electrolyte has run out of salt" in run.failure.limit
    assert run.failure.unfinished
    last = run.trajectory.steps[-1]
    assert (last.kind, last.cycle) == (StepKind.CC_DISCHARGE, 1)
    seconds = run.trajectory.time[last.stop - 1] - run.trajectory.time[last.start]
    assert 20.0 < seconds < 200.0
    assert run.failure.reached_s == pytest.approx(run.trajectory.duration)


@pytest.mark.slow
def test_it_runs_at_lower_currents(tmp_path: Path) -> None:
    space, candidate = starved()
    experiment = Experiment("x", NOTHING, protocol(2, 2, 4.2, 2.5))
    task = Task("starved", CellModel("Ecker2015", "DFN", MODEL_OPTIONS), space, (experiment,))
    simulator = PyBaMMSimulator(PyBaMMOptions(), RunContext(task, 1, tmp_path))
    try:
        experiments = simulator.reduce_task(TaskReduction(0.25))
        assert simulator.reduce_task(TaskReduction(0.25)) is experiments
        ((place, outcome),) = simulator.simulate_variant([candidate], experiments, False)
    finally:
        simulator.close()
    assert place == 0
    assert outcome.ok
    assert outcome.runs[0].trajectory is not None
    assert outcome.runs[0].trajectory.cycles == (1, 2)
