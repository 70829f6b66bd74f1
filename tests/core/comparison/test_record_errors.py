from dataclasses import replace

import numpy as np
import pytest
from bsa.core.cell import CURRENT, VOLTAGE
from bsa.core.comparison.record_errors import RecordErrors, errors_by_record, misfits
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa_toy_life import life, life_task
from hypothesis import given
from hypothesis import strategies as st


def two_steps(temperature: float | None = None) -> Trajectory:
    """A discharge of 100 s and a rest of 300 s, a sample every 10 s."""
    time = np.concatenate([np.arange(0.0, 101.0, 10.0), np.arange(100.0, 401.0, 10.0)])
    current = np.where(np.arange(len(time)) < 11, 1.0, 0.0)
    kelvin = None if temperature is None else np.full_like(time, temperature)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 11), Step(StepKind.REST, 11, len(time), position=1))
    return Trajectory(time, current, np.full_like(time, 3.7), kelvin, steps)


def task_of(record: Trajectory) -> Task:
    space = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0),))
    return Task("t", CellModel("Chen2020"), space, (Experiment("r", record),), signals=(CURRENT, VOLTAGE))


def outcome(simulated: Trajectory, failure: SimulationFailure | None = None) -> Outcome:
    return Outcome((ExperimentRun(simulated, failure),), 0.1)


def test_errors_are_told_whole_and_step_by_step_in_millivolts() -> None:
    record = two_steps()
    error = np.where(np.arange(len(record)) < 11, 0.030, -0.010)
    (found,) = errors_by_record(task_of(record), outcome(record.changed(voltage=record.voltage + error)))
    whole, (discharge, rest) = found.signals["voltage"], found.steps
    assert whole.unit == "mV"
    assert whole.rms == pytest.approx(np.sqrt((100 * 30.0**2 + 300 * 10.0**2) / 400))
    assert whole.max == pytest.approx(30.0)
    assert (discharge.name, discharge.duration_s) == ("CC discharge", 100.0)
    assert discharge.signals["voltage"].rms == pytest.approx(30.0)
    assert (rest.start_s, rest.signals["voltage"].rms) == (100.0, pytest.approx(10.0))
    assert set(found.signals) == {"voltage"}


def test_the_worst_hundredth_of_the_time_is_left_out_and_no_more() -> None:
    time = np.arange(0.0, 1001.0)
    record = Trajectory(time, np.ones_like(time), np.full_like(time, 3.7), None, (Step(StepKind.DRIVE, 0, len(time)),))
    error = np.where(time > 990.5, 1.0, 0.001)  # a knee that lasts just under a hundredth of the time
    (found,) = errors_by_record(task_of(record), outcome(record.changed(voltage=record.voltage + error)))
    assert found.signals["voltage"].rms_99 == pytest.approx(1.0, rel=1e-6)
    assert found.signals["voltage"].rms > 90.0


@pytest.mark.parametrize("inserted", [[], [5, 6], [30]])
def test_a_sample_at_a_jump_is_not_the_largest_error(inserted: list[int]) -> None:
    record = two_steps()
    steps = (Step(StepKind.CC_DISCHARGE, 0, 11), Step(StepKind.REST, 11, 12, position=1))
    steps += (Step(StepKind.REST, 12, len(record), position=2),)
    record = replace(record, steps=steps, inserted=np.isin(np.arange(len(record)), inserted))
    error = np.where(np.arange(len(record)) == 11, 0.2, 0.0)
    error[20] = 0.005
    (found,) = errors_by_record(task_of(record), outcome(record.changed(voltage=record.voltage + error)))
    assert found.signals["voltage"].max == pytest.approx(5.0)


@pytest.mark.slow
@given(st.lists(st.floats(-1.0, 1.0), min_size=42, max_size=42))
def test_what_is_left_out_is_never_the_better_part(errors: list[float]) -> None:
    record = two_steps()
    (found,) = errors_by_record(task_of(record), outcome(record.changed(voltage=record.voltage + np.array(errors))))
    error = found.signals["voltage"]
    assert error.rms_99 <= error.rms + 1e-9
    assert error.rms <= error.max + 1e-9
    assert RecordErrors.from_json(found.as_json()) == found


def test_temperature_counts_where_it_was_measured_and_simulated() -> None:
    record, warm = two_steps(298.0), two_steps(300.5)
    (found,) = errors_by_record(task_of(record), outcome(warm))
    assert (found.signals["temperature"].unit, found.signals["temperature"].rms) == ("K", pytest.approx(2.5))
    (unknown,) = errors_by_record(task_of(record), outcome(two_steps()))
    assert "temperature" not in unknown.signals


def test_a_simulation_that_stopped_early_is_told_as_far_as_it_got() -> None:
    record = two_steps()
    stopped = SimulationFailure("the cell is empty", reached_s=100.0)
    (found,) = errors_by_record(task_of(record), outcome(record.slice(0, 11), stopped))
    assert found.failure == "the cell is empty, after 100 of 400 s"
    assert [step.name for step in found.steps] == ["CC discharge"]
    (nothing,) = errors_by_record(
        task_of(record), Outcome((ExperimentRun(None, replace(stopped, cause="no start", reached_s=0.0)),), 0.1)
    )
    assert (nothing.failure, nothing.signals) == ("no start, after 0 of 400 s", {})


def test_a_lone_sample_at_a_jump_is_no_largest_error() -> None:
    time = np.array([0.0, 0.002, 10.0, 20.0])
    steps = (Step(StepKind.REST, 0, 1), Step(StepKind.CC_DISCHARGE, 1, 4, position=1))
    record = Trajectory(time, np.array([0.0, 1.0, 1.0, 1.0]), np.full(4, 3.7), None, steps)
    off = record.voltage + np.array([0.150, 0.010, 0.010, 0.010])
    (found,) = errors_by_record(task_of(record), outcome(record.changed(voltage=off)))
    assert found.signals["voltage"].max == pytest.approx(10.0)
    assert [step.name for step in found.steps] == ["CC discharge"]


def test_a_life_is_judged_step_by_step_and_by_its_capacities() -> None:
    target, simulated = life(50, 0.20), life(50, 0.21)
    (found,) = errors_by_record(life_task(target), outcome(simulated))
    lost = 0.01 * np.arange(50) / 49
    assert found.signals["capacity"].unit == "%"
    assert found.signals["capacity"].max == pytest.approx(1.0)
    assert found.signals["capacity"].rms == pytest.approx(100.0 * np.sqrt(np.mean(lost**2)))
    # The clocks of later cycles differ by minutes; the voltages of their steps by 0.2 mV.
    assert found.signals["voltage"].max == pytest.approx(0.2)
    (close,) = errors_by_record(life_task(target), outcome(life(50, 0.20)))
    of_both = misfits([found, close])
    assert of_both["capacity"] == pytest.approx(100.0 * np.sqrt(np.mean(lost**2) / 2))
    assert set(of_both) == {"capacity", "voltage"}
    assert misfits([]) == {}


def test_samples_that_no_instrument_took_have_no_errors() -> None:
    record = two_steps()
    put_in = np.arange(len(record)) == 11
    error = np.where(put_in, 0.5, 0.001)
    believed = errors_by_record(task_of(record), outcome(record.changed(voltage=record.voltage + error)))
    (found,) = errors_by_record(
        task_of(replace(record, inserted=put_in)), outcome(record.changed(voltage=record.voltage + error))
    )
    assert believed[0].signals["voltage"].rms > 20.0
    assert found.signals["voltage"].rms == pytest.approx(1.0)
    assert found.steps[1].signals["voltage"].max == pytest.approx(1.0)
