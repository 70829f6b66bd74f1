"""The time that one evaluation may take."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.hooks import RunContext
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.simulators.simulator import PyBaMMOptions, PyBaMMSimulator


def drive(samples: int) -> Experiment:
    time = np.arange(float(samples))
    step = (Step(StepKind.PULSE, 0, samples),)
    return Experiment("drive", Trajectory(time, np.ones(samples), np.full(samples, 3.7), None, step))


@pytest.mark.parametrize(("samples", "limit_s"), [(100, 30.0), (10_000, 30.0), (48_000, 144.0)])
def test_a_record_of_many_samples_may_take_longer(samples: int, limit_s: float, tmp_path: Path) -> None:
    space = ParameterSpace((Parameter("Electrode width [m]", 1.0, 0.5, 2.0, "linear"),))
    task = Task("t", CellModel("Chen2020"), space, (drive(100),))
    simulator = PyBaMMSimulator(PyBaMMOptions(), RunContext(task, 1, tmp_path))
    assert simulator._limit_s((drive(samples),)) == limit_s
    by_protocol = replace(drive(samples), protocol=(("Rest for 1 hour",),) * 40)
    assert simulator._limit_s((by_protocol,)) == 60.0
