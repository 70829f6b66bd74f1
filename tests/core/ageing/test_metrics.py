from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.ageing.metrics import AgeingMetrics
from bsa.core.comparison.record_errors import errors_by_record
from bsa.core.comparison.residuals import noise_of_residuals, residuals
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.metrics import decode_metrics, errors_of, evaluate, headline_of
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Task
from bsa.core.task_reduction import shortened
from bsa.core.trajectory import Trajectory

Record = Callable[..., Trajectory]
MakeTask = Callable[..., Task]
Run = Callable[[Trajectory], Outcome]


def test_the_record_itself_has_no_error(record: Record, task: MakeTask, outcome: Run) -> None:
    target = record(fade=1e-3)
    metrics = evaluate(task(target), outcome(target))
    assert isinstance(metrics, AgeingMetrics)
    assert metrics.mape == metrics.fade_error == metrics.resistance_error == metrics.v_rmse_mv == 0.0
    found = residuals(task(target), outcome(target))
    assert found is not None
    assert not np.any(found)
    assert noise_of_residuals(task(target)).shape == found.shape


def test_each_cycle_is_compared_from_its_own_start(record: Record, task: MakeTask, outcome: Run) -> None:
    # 0.4 % too much capacity in cycle 2 to 5 each: on one clock cycle 5 would be four times as far off.
    target, longer = record(fade=0.0, count=5), record(fade=-0.004, count=5)
    metrics = evaluate(task(target, 5), outcome(longer))
    assert isinstance(metrics, AgeingMetrics)
    assert metrics.q_mape == pytest.approx(100 * 0.004 * np.mean(np.array(target.cycles) - 1), rel=1e-6)
    assert metrics.fade_error == pytest.approx(100 * 0.004 * 2)
    # The end of each step of cycle n is off by 0.4 (n - 1) % and nothing else is.
    assert metrics.i_mape < 3 * metrics.q_mape
    assert metrics.objective == metrics.mape == metrics.q_mape + metrics.i_mape + metrics.v_mape


def test_resistances_are_compared_where_the_record_has_them(record: Record, task: MakeTask, outcome: Run) -> None:
    target = record(fade=1e-3, rise=0.0)
    metrics = evaluate(task(target), outcome(record(fade=1e-3, rise=1e-4)))
    assert isinstance(metrics, AgeingMetrics)
    assert metrics.resistance_error == pytest.approx(100 * 1e-4 * 24.5 / 0.02)
    assert metrics.fade_error == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        (50, ["Resistance error over all cycles"]),
        (2, ["Resistance error of 2 cycles"]),
        (1, ["Resistance error of 1 cycle"]),
        (0, []),
    ],
)
def test_the_resistance_error_says_of_how_many_cycles_it_is(
    record: Record, task: MakeTask, known: int, expected: list[str]
) -> None:
    target = record(fade=1e-3)
    table = target.cycle_table
    assert table is not None
    few = replace(table, resistance_ohm=np.where(np.arange(len(table)) < known, table.resistance_ohm, np.nan))
    labels = [quantity.label for quantity in headline_of(task(replace(target, cycle_table=few)))]
    assert [label for label in labels if label.startswith("Resistance")] == expected


def test_the_fade_between_the_curves_counts_in_a_fit(record: Record, task: MakeTask, outcome: Run) -> None:
    target = record(fade=1e-3, kept=(1, 50))
    table = target.cycle_table
    assert table is not None
    bent = replace(table, capacity_ah=table.capacity_ah - 0.01 * np.sin(np.pi * (table.cycle - 1) / 49))
    found = residuals(task(target), outcome(replace(target, cycle_table=bent)))
    assert found is not None
    assert np.max(np.abs(found)) == pytest.approx(10.0, rel=0.1)


def test_a_life_that_ends_early_has_no_metrics(record: Record, task: MakeTask) -> None:
    target = record(fade=1e-3)
    short = record(fade=1e-3, count=20, kept=tuple(cycle for cycle in target.cycles if cycle <= 20))
    failed = Outcome((ExperimentRun(short, SimulationFailure("dead", "Rest", 21)),))
    assert evaluate(task(target), failed) is None


def test_a_long_task_and_its_metrics_survive_the_journal(record: Record, task: MakeTask, outcome: Run) -> None:
    made = task(record(fade=1e-3))
    written = encode_task(made)
    assert written["experiments"][0]["protocol"] == [
        "50 x [Charge at 1 A until 4.2 V, Rest for 1 minute, Discharge at 1 A until 3 V]"
    ]
    read = decode_task(written)
    assert encode_task(read) == written
    assert read.long
    metrics = evaluate(read, outcome(record(fade=2e-3)))
    assert metrics is not None
    assert decode_metrics(metrics.as_json()) == metrics
    assert {quantity.key for quantity in errors_of(read)} <= set(metrics.as_json())


def test_the_first_cycles_of_a_long_task_are_a_long_task(record: Record, task: MakeTask, outcome: Run) -> None:
    made = task(record(fade=1e-3))
    first = replace(made, experiments=(shortened(made.experiments[0], 1),))
    assert first.experiments[0].detailed_cycles == (1,)
    assert len(first.experiments[0].protocol or ()) == 1
    metrics = evaluate(first, outcome(record(fade=5e-3, count=1)))
    assert metrics is not None
    assert metrics.objective == pytest.approx(0.0, abs=1e-9)


def test_what_a_long_record_lacks_is_said(record: Record, task: MakeTask) -> None:
    target = record(fade=1e-3)
    with pytest.raises(BsaError, match="lacks its cycle table"):
        task(replace(target, cycle_table=None))
    with pytest.raises(BsaError, match="has a cycle 50, but its protocol has 40"):
        task(target, 40)
    made = task(target)
    whole = replace(made.experiments[0], detailed_cycles=())
    with pytest.raises(BsaError, match="mixes records"):
        replace(made, experiments=(*made.experiments, whole))
    with pytest.raises(BsaError, match=r"curves of the cycles \[3\]"):
        replace(made, experiments=(replace(made.experiments[0], detailed_cycles=(1, 3)),))


def test_an_error_says_over_which_cycles_it_is(record: Record, task: MakeTask) -> None:
    life = task(record(fade=1e-3, kept=(1, 20, 50)))
    labels = {one.key: one.label for one in headline_of(life)}
    assert labels["v_rmse_mv"] == "Voltage RMSE at equal times of 3 cycles"
    assert labels["capacity_error"] == "Capacity error of 3 cycles"
    assert labels["fade_error"] == "Capacity error over all cycles"
    assert {one.key: one.label for one in errors_of(life)}["v_rmse_mv"] == labels["v_rmse_mv"]


def test_a_cell_that_gives_no_charge_any_more_is_no_good_fit(record: Record, task: MakeTask, outcome: Run) -> None:
    target = record(fade=0.0)
    table = target.cycle_table
    assert table is not None
    # Its last 10 of 50 discharges end before they begin: the simulation goes on without them.
    dead = outcome(replace(target, cycle_table=table.up_to(40)))
    assert dead.ok
    assert residuals(task(target), dead) is None
    metrics = evaluate(task(target), dead)
    assert isinstance(metrics, AgeingMetrics)
    assert metrics.fade_error == pytest.approx(20.0)
    (errors,) = errors_by_record(task(target), dead)
    assert errors.signals["capacity"].max == pytest.approx(100.0)
