import json
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.residuals import residuals
from bsa.core.comparison.signal_metrics import MISFIT, SignalMetrics, voltage_rmse_mv
from bsa.core.errors import BsaError
from bsa.core.metrics import Quantity, decode_metrics, errors_of, evaluate, headline_of, objective_of, told_of
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa_toy_cell import CAPACITY, HIDDEN, record, space, toy_task


def outcome_of(trajectory: Trajectory) -> Outcome:
    return Outcome((ExperimentRun(trajectory),))


def constant(current: float, voltage: float, seconds: int) -> Trajectory:
    n = seconds + 1
    steps = (Step(StepKind.CC_DISCHARGE, 0, n),)
    return Trajectory(np.arange(float(n)), np.full(n, current), np.full(n, voltage), None, steps)


def test_a_perfect_simulation_has_no_error() -> None:
    metrics = evaluate(toy_task(), outcome_of(record(HIDDEN)))
    assert metrics is not None
    assert metrics.mape == metrics.rmse == metrics.capacity_error == 0.0
    assert metrics.v_rmse_mv < 1e-6


def test_the_papers_numbers_by_hand() -> None:
    # 100 s against 80 s at 2 % more current and 1 % less voltage: the last 20 of 100 samples are padded with zeros.
    target, simulated = constant(1.0, 4.0, 100), constant(1.02, 3.96, 80)
    task = Task("t", CellModel("x"), space(), (Experiment("r", target, (("Discharge at 1 A for 100 s",),)),))
    metrics = evaluate(task, outcome_of(simulated))
    assert metrics is not None
    assert metrics.i_mape == pytest.approx(0.8 * 2.0 + 0.2 * 100.0)
    assert metrics.v_mape == pytest.approx(0.8 * 1.0 + 0.2 * 100.0)
    assert metrics.q_mape == pytest.approx(100.0 * (1 - 0.8 * 1.02))
    assert metrics.mape == pytest.approx(metrics.q_mape + metrics.i_mape + metrics.v_mape)
    q, i = 100 / 3600 * (1 - 0.816), np.sqrt(0.8 * 0.02**2 + 0.2 * 1.0)
    assert metrics.rmse == pytest.approx(q + i + np.sqrt(0.8 * 0.04**2 + 0.2 * 16.0))
    assert metrics.v_rmse_mv == pytest.approx(40.0)
    assert metrics.objective == metrics.mape


def test_samples_where_the_reference_is_zero_do_not_count() -> None:
    target = record(HIDDEN)
    other = record({**HIDDEN, CAPACITY: HIDDEN[CAPACITY] * 0.9})
    metrics = evaluate(toy_task(), outcome_of(other))
    assert metrics is not None
    # The last tenth of the discharge meets a simulation that rests already; rests themselves do not count.
    assert metrics.i_mape == pytest.approx(10.0, abs=0.5)
    assert metrics.capacity_error == pytest.approx(1 - other.discharge_capacity[-1] / target.discharge_capacity[-1])


def test_a_measured_current_is_judged_by_voltage_alone() -> None:
    target = record(HIDDEN)
    shifted = Trajectory(target.time, target.current, target.voltage + 0.01, None, target.steps)
    task = Task("t", CellModel("x"), space(), (Experiment("r", target),))
    metrics = evaluate(task, outcome_of(shifted))
    assert metrics is not None
    assert metrics.objective == pytest.approx(10.0)


def test_robust_weights_judge_by_most_of_the_time_and_flatten_far_residuals() -> None:
    target = constant(1.0, 4.0, 1000)
    knee = np.where(target.time > 990.5, 1.0, 0.005)
    simulated = target.changed(voltage=target.voltage + knee)
    uniform = Task("t", CellModel("x"), space(), (Experiment("r", target),))
    robust = replace(uniform, weight="robust")
    before, after = (evaluate(task, outcome_of(simulated)) for task in (uniform, robust))
    assert before is not None
    assert after is not None
    assert before.objective == before.v_rmse_mv == after.v_rmse_mv > 90.0
    assert after.objective == pytest.approx(5.0, rel=1e-6)
    assert objective_of(robust).of_unit == "mV voltage RMSE over 99 % of the time"
    squares, flattened = (
        residuals(task, outcome_of(target.changed(voltage=target.voltage + 0.1))) for task in (uniform, robust)
    )
    assert squares == pytest.approx(100.0)
    assert flattened == pytest.approx(10.0 * np.arcsinh(10.0))


def test_a_cell_that_is_empty_for_the_last_seconds_does_not_fall_between_the_residuals() -> None:
    target = constant(1.0, 3.5, 3600)
    emptied = target.changed(voltage=np.where(target.time > 3580.0, 0.5, 3.5))
    task = Task("t", CellModel("x"), space(), (Experiment("r", target),))
    found = residuals(task, outcome_of(emptied))
    assert found is not None
    assert np.abs(found[:-1]).max() == 0.0
    assert abs(found[-1]) == pytest.approx(3000.0 * 20.0 / 90.0, rel=0.15)


def test_nor_does_half_a_minute_of_a_day() -> None:
    day = constant(1.0, 3.5, 86400)
    emptied = day.changed(voltage=np.where(day.time > day.time[-1] - 30.0, 0.5, 3.5))
    found = residuals(Task("t", CellModel("x"), space(), (Experiment("r", day),)), outcome_of(emptied))
    assert found is not None
    assert abs(found[-1]) == pytest.approx(3000.0 * 30.0 / (86400 / 40), rel=0.15)


def test_a_weight_that_does_not_exist_is_refused() -> None:
    with pytest.raises(BsaError, match='"heavy"') as error:
        replace(toy_task(), weight="heavy")
    assert "uniform, robust" in error.value.hint


def test_a_cycle_that_ends_where_it_began_is_judged_by_its_discharge() -> None:
    """The net charge of it is next to nothing, and so is a current of a resting cell."""

    def cycle(amperes: float, resting: float) -> Trajectory:
        current = np.concatenate([np.full(3600, -1.0), np.full(3600, amperes), np.full(3600, resting)])
        steps = (
            Step(StepKind.CC_CHARGE, 0, 3600),
            Step(StepKind.CC_DISCHARGE, 3600, 7200, position=1),
            Step(StepKind.REST, 7200, 10800, position=2),
        )
        return Trajectory(np.arange(10800.0), current, np.full(10800, 4.0), None, steps)

    experiment = Experiment("r", cycle(1.0, 5e-4), (("Charge at 1 A for 1 hour", "Discharge at 1 A for 1 hour"),))
    metrics = evaluate(Task("t", CellModel("x"), space(), (experiment,)), outcome_of(cycle(1.02, 0.0)))
    assert metrics is not None
    assert metrics.q_mape == pytest.approx(2.0, abs=0.1)
    assert metrics.i_mape == pytest.approx(1.0, abs=0.1)


def test_a_record_without_a_discharge_has_no_error_of_its_capacity() -> None:
    charge = constant(-1.0, 4.0, 100)
    charge = replace(charge, steps=(Step(StepKind.CC_CHARGE, 0, 100),))
    protocol = (("Charge at 1 A for 100 s",),)
    task = Task("t", CellModel("x"), space(), (Experiment("charge", charge, protocol),))
    metrics = evaluate(task, outcome_of(charge.changed(voltage=charge.voltage + 0.04)))
    assert metrics is not None
    assert metrics.capacity_error is None
    assert np.isnan(metrics.value("capacity_error"))
    assert metrics.mape == pytest.approx(1.0)
    assert decode_metrics(json.loads(json.dumps(metrics.as_json()))) == metrics
    keys = [quantity.key for of in (errors_of, headline_of, told_of) for quantity in of(task)]
    assert "capacity_error" not in keys
    # Beside one with a discharge that one tells it.
    discharge = Experiment("discharge", constant(1.0, 4.0, 100), (("Discharge at 1 A for 100 s",),))
    both = replace(task, experiments=(*task.experiments, discharge))
    longer = Outcome((ExperimentRun(charge), ExperimentRun(constant(1.1, 4.0, 100))))
    metrics = evaluate(both, longer)
    assert metrics is not None
    assert metrics.capacity_error == pytest.approx(0.1)
    assert "capacity_error" in [quantity.key for quantity in headline_of(both)]


def test_an_error_that_a_trial_does_not_have_is_not_its_misfit() -> None:
    of_spectrum = SignalMetrics(3.2, {"resistance_rmse_mohm": 1.0})
    assert of_spectrum.value("objective") == 3.2
    assert of_spectrum.value("resistance_rmse_mohm") == 1.0
    assert np.isnan(voltage_rmse_mv(of_spectrum))
    assert Quantity("voltage_rmse_mv", "Voltage RMSE", "mV").shown(of_spectrum) is None
    assert MISFIT.shown(of_spectrum) == 3.2


def test_a_run_that_never_reached_the_scored_cycle_has_no_metrics() -> None:
    target = record(HIDDEN)
    task = Task("t", CellModel("x"), space(), (Experiment("r", target, (("x",),), scored_cycle=1),))
    assert evaluate(task, outcome_of(target)) is not None
    assert evaluate(task, Outcome((ExperimentRun(None),))) is None


def test_denser_sampling_does_not_count_more() -> None:
    target = constant(1.0, 4.0, 1000)
    dense = Trajectory(
        np.concatenate([np.linspace(0, 100, 1000), np.linspace(101, 1000, 10)]),
        np.ones(1010),
        np.concatenate([np.full(1000, 4.0), np.full(10, 4.01)]),
        None,
        (Step(StepKind.CC_DISCHARGE, 0, 1010),),
    )
    task = Task("t", CellModel("x"), space(), (Experiment("r", dense),))
    metrics = evaluate(task, outcome_of(target))
    assert metrics is not None
    assert metrics.v_rmse_mv == pytest.approx(10.0 * np.sqrt(0.9), rel=0.01)


def test_a_pulse_counts_as_long_as_the_rest_behind_it() -> None:
    kinds = [(StepKind.REST, 100), (StepKind.PULSE, 10), (StepKind.REST, 400), (StepKind.CC_DISCHARGE, 40)]
    ends = np.cumsum([seconds for _, seconds in kinds])
    steps = tuple(Step(kind, end - seconds, end) for (kind, seconds), end in zip(kinds, ends, strict=True))
    record = Trajectory(np.arange(550.0), np.ones(550), np.full(550, 3.7), None, steps)
    task = Task("t", CellModel("x"), space(), (Experiment("r", record),))
    found = residuals(task, outcome_of(record.changed(voltage=record.voltage + 0.001)))
    assert found is not None
    before, pulse, after, brief = found.reshape(4, -1)[:, 0] ** 2
    assert pulse == pytest.approx(after * 399 / 399)
    assert before == pytest.approx(after * 99 / 399)
    assert brief == pytest.approx(after * 39 / 399)
    assert np.mean(found**2) == pytest.approx(1.0)  # 1 mV is one tolerance


def test_a_record_of_many_steps_counts_as_much_as_one_of_few() -> None:
    pulses = Trajectory(
        np.arange(1200.0),
        np.ones(1200),
        np.full(1200, 3.7),
        None,
        tuple(Step(StepKind.CC_DISCHARGE, first, first + 20, position=first) for first in range(0, 1200, 20)),
    )
    records = (pulses, constant(1.0, 3.7, 1000))
    task = Task("t", CellModel("x"), space(), tuple(Experiment(f"r{n}", one) for n, one in enumerate(records)))

    def squares(*off_mv: float) -> float:
        runs = [
            ExperimentRun(one.changed(voltage=one.voltage + 1e-3 * mv)) for one, mv in zip(records, off_mv, strict=True)
        ]
        found = residuals(task, Outcome(tuple(runs)))
        assert found is not None
        return float(found @ found) / len(found)

    assert squares(1.0, 0.0) == pytest.approx(0.5, rel=1e-3)
    assert squares(0.0, 1.0) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize(("pulses", "late_ohm", "counts"), [(12, 0.1, False), (6, 0.1, True), (12, 0.05, True)])
def test_pulses_of_a_nearly_empty_cell_do_not_count_in_a_pulse_test(pulses: int, late_ohm: float, counts: bool) -> None:
    kinds = [StepKind.PULSE, StepKind.REST] * pulses + [StepKind.CC_DISCHARGE, StepKind.REST]
    kinds += [StepKind.PULSE, StepKind.REST]
    ends = 20 * np.arange(1, len(kinds) + 1)
    steps = tuple(Step(kind, end - 20, end, position=end) for kind, end in zip(kinds, ends, strict=True))
    current = np.concatenate([np.full(20, {StepKind.REST: 0.0}.get(kind, 1.0)) for kind in kinds])
    current[-80:-60] = 20.0  # after this discharge little charge is left to be drawn
    ohm = np.where(np.arange(len(current)) < len(current) - 60, 0.05, late_ohm)
    record = Trajectory(np.arange(20.0 * len(kinds)), current, 3.7 - ohm * current, None, steps)
    task = Task("t", CellModel("x"), space(), (Experiment("r", record),))
    found = residuals(task, outcome_of(record.changed(voltage=record.voltage + 0.001)))
    assert found is not None
    by_step = found.reshape(len(kinds), -1)
    assert np.all(by_step[:-2] > 0)  # the rest behind the last discharge too
    assert np.all(by_step[-2:] > 0) == counts
    assert np.any(by_step[-2:] > 0) == counts


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pulses_of_both_signs_at_one_state_of_charge_count_all(sign: float) -> None:
    kinds = [StepKind.PULSE, StepKind.REST] * 24
    steps = tuple(Step(kind, 20 * place, 20 * place + 20, position=place) for place, kind in enumerate(kinds))
    current = np.concatenate([np.full(20, sign * (0, 1, 0, -1)[(place + 1) % 4]) for place in range(len(kinds))])
    record = Trajectory(np.arange(float(len(current))), current, 3.7 - 0.05 * current, None, steps)
    task = Task("t", CellModel("x"), space(), (Experiment("r", record),))
    found = residuals(task, outcome_of(record.changed(voltage=record.voltage + 0.001)))
    assert found is not None
    assert np.all(found > 0)
