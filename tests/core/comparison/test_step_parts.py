import numpy as np
import pytest
from bsa.core.cell import VOLTAGE
from bsa.core.comparison.alignment import StepPair, pair_steps
from bsa.core.comparison.residuals import residuals, rows_of
from bsa.core.comparison.step_parts import count_of_parts, step_parts
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.rms import rms
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory

SPACE = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0),))


def pulse_rest_and_drive(pulse_every_s: float = 0.1) -> Trajectory:
    """A pulse of ten seconds, a rest of ten minutes and a drive of an hour that changes every second."""
    pulse = np.arange(0.0, 10.0 + pulse_every_s / 2, pulse_every_s)
    rest = np.arange(20.0, 611.0, 10.0)
    drive = np.arange(611.0, 4212.0, 1.0)
    time = np.concatenate([pulse, rest, drive])
    current = np.concatenate(
        [np.full(len(pulse), 3.0), np.zeros(len(rest)), 2.0 + np.random.default_rng(3).normal(0.0, 1.0, len(drive))]
    )
    ends = np.cumsum([len(pulse), len(rest), len(drive)])
    steps = (
        Step(StepKind.PULSE, 0, ends[0]),
        Step(StepKind.REST, ends[0], ends[1], position=1),
        Step(StepKind.DRIVE, ends[1], ends[2], position=2),
    )
    return Trajectory(time, current, np.full_like(time, 3.7), None, steps)


def pairs(record: Trajectory) -> list[StepPair]:
    return pair_steps(record, Experiment("r", record))


def task_of(record: Trajectory) -> Task:
    return Task("t", CellModel("Chen2020"), SPACE, (Experiment("r", record),))


def test_each_decade_of_a_pulse_has_as_many_parts() -> None:
    middles = 10.0 * step_parts(pairs(pulse_rest_and_drive())[0], VOLTAGE).fractions.mean(axis=1)
    first, second = np.count_nonzero(middles < 1.0), np.count_nonzero(middles >= 1.0)
    assert first == pytest.approx(second, abs=2)


def test_a_pulse_has_no_part_before_its_first_sample_but_one() -> None:
    middles = 10.0 * step_parts(pairs(pulse_rest_and_drive(pulse_every_s=0.2))[0], VOLTAGE).fractions.mean(axis=1)
    assert np.count_nonzero(middles < 0.2) == 1


def test_parts_of_a_constant_signal_are_equally_long() -> None:
    parts = step_parts(pairs(pulse_rest_and_drive())[1], VOLTAGE)
    assert np.allclose(parts.weights, 1.0 / len(parts.weights))
    assert np.allclose(parts.ends, np.cumsum(parts.weights))


def discharge_with_a_knee() -> Trajectory:
    """An hour at constant current; the voltage falls by 0.3 V in 59 minutes and by 1 V in the last one."""
    time = np.arange(0.0, 3601.0, 5.0)
    voltage = np.interp(time, [0.0, 3540.0, 3600.0], [4.0, 3.7, 2.7])
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time)),)
    return Trajectory(time, np.full_like(time, 2.0), voltage, None, steps)


def test_a_knee_is_in_many_parts_which_count_by_their_duration() -> None:
    record = discharge_with_a_knee()
    parts = step_parts(pairs(record)[0], VOLTAGE)
    late = parts.fractions.mean(axis=1) > 3540.0 / 3600.0
    assert np.count_nonzero(late) == pytest.approx(len(late) * (0.2 / 1.3 + 0.8 / 60.0), abs=1)
    assert np.sum(parts.weights[late]) == pytest.approx(1.0 / 60.0, rel=0.2)
    assert np.sum(parts.weights) == pytest.approx(1.0)


def test_an_error_that_changes_its_sign_at_a_knee_counts() -> None:
    record = discharge_with_a_knee()
    assert record.voltage is not None
    # The knee is steeper at first and flatter at the end: 0.2 V too low, then 0.2 V too high.
    wrong = record.changed(
        voltage=np.interp(record.time, [0.0, 3540.0, 3555.0, 3585.0, 3600.0], [4.0, 3.7, 3.25, 3.15, 2.7])
    )
    found = residuals(task_of(record), Outcome((ExperimentRun(wrong),)))
    squares = np.square(record.voltage - np.asarray(wrong.voltage))
    whole_mv = 1e3 * np.sqrt(np.trapezoid(squares, record.time) / 3600.0)
    assert rms(found) / whole_mv == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("place", range(3))
def test_parts_lie_in_the_step_in_order(place: int) -> None:
    pair = pairs(pulse_rest_and_drive())[place]
    fractions = step_parts(pair, VOLTAGE).fractions
    assert len(fractions) == count_of_parts(pair.step.kind, VOLTAGE)
    assert np.all(np.diff(fractions.ravel()) > 0.0)
    assert 0.0 < fractions.min() < fractions.max() < 1.0


def test_a_mismatch_that_goes_with_the_current_of_a_drive_does_not_average_out() -> None:
    record = pulse_rest_and_drive()
    task = task_of(record)
    wrong = record.changed(voltage=record.voltage - 0.02 * (record.current - 2.0) * (record.time >= 611.0))
    found = residuals(task, Outcome((ExperimentRun(wrong),)))
    assert found is not None
    assert rms(found[rows_of(task).step == 2]) > 12.0


def test_a_wrong_first_second_of_a_pulse_counts_as_much_as_the_nine_behind_it() -> None:
    record = pulse_rest_and_drive()
    task = task_of(record)
    early = record.time < 1.0
    late = (record.time >= 1.0) & (record.time <= 10.0)
    sizes = []
    for where in (early, late):
        found = residuals(task, Outcome((ExperimentRun(record.changed(voltage=record.voltage + 0.01 * where)),)))
        assert found is not None
        sizes.append(rms(found[rows_of(task).step == 0]))
    assert sizes[0] == pytest.approx(sizes[1], rel=0.2)


def test_the_misfit_is_that_of_the_record_whatever_its_steps() -> None:
    record = pulse_rest_and_drive()
    found = residuals(task_of(record), Outcome((ExperimentRun(record.changed(voltage=record.voltage + 2e-3)),)))
    assert rms(found) == pytest.approx(2.0)
