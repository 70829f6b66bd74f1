"""How far residuals are off by the clock and the charge of steep records."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.comparison.knees import CLOCK_SHARE, knees_of_residuals
from bsa.core.comparison.residuals import residuals, rows_of
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory

SPACE = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0),))


def discharge(knee_v: float = 0.0, kind: StepKind = StepKind.CC_DISCHARGE, slope_v: float = 0.5) -> Trajectory:
    """An hour at 1 A and a rest of an hour, a sample every 10 s; the voltage falls by the knee in the last percent."""
    time = np.arange(0.0, 7201.0, 10.0)
    loaded = time <= 3600.0
    fall = slope_v * np.minimum(time, 3600.0) / 3600.0 + knee_v * np.clip((time - 3564.0) / 36.0, 0.0, 1.0)
    voltage = np.where(loaded, 4.0 - fall, 3.6)
    steps = (Step(kind, 0, 361), Step(StepKind.REST, 361, len(time), position=1))
    return Trajectory(time, loaded.astype(np.float64), voltage, None, steps)


def task_of(record: Trajectory, **how: object) -> Task:
    return Task("t", CellModel("Chen2020"), SPACE, (Experiment("r", record, **how),))


def test_a_knee_is_told_neither_by_the_clock_nor_by_the_charge() -> None:
    task = task_of(discharge(knee_v=1.0))
    rows, found = rows_of(task), knees_of_residuals(task)
    loaded = found[: len(found) // 2]
    assert len(rows.record) == len(found)
    # 0.2 % of the charge is a fifth of the knee: 200 mV over the last hundredth of the step.
    assert loaded[-1] > 10.0
    before = rows.since_s[: len(loaded)] < 3540.0
    assert np.all(loaded[before] < 0.5)
    assert not found[len(found) // 2 :].any()  # nothing moves in the rest


def test_a_slope_is_no_knee_and_the_clock_moves_it_by_its_share() -> None:
    task = task_of(discharge())
    loaded = knees_of_residuals(task)[1:39]
    as_late = discharge()
    late_v = 0.5 * CLOCK_SHARE * 10.0 / 3600.0
    offset = as_late.changed(voltage=as_late.voltage + late_v)
    by_offset = residuals(task, Outcome((ExperimentRun(offset),)))[1:39]
    np.testing.assert_allclose(loaded, np.abs(by_offset), rtol=0.05)


@pytest.mark.parametrize("knee_v", [0.0, 1.0])
def test_a_varying_current_and_a_protocol_have_no_knee_of_the_charge(knee_v: float) -> None:
    driven = knees_of_residuals(task_of(discharge(knee_v, StepKind.DRIVE)))
    # The clock alone: half a second of a fall of a volt in 36 s.
    assert driven.max() < 15.0
    told = task_of(discharge(knee_v), protocol=(("Discharge at 1 A for 1 hour", "Rest for 1 hour"),), initial_soc=0.9)
    assert not knees_of_residuals(told).any()
