"""The rows that tell the errors of records."""

from dataclasses import replace

from bsa.core.comparison.record_errors import RecordErrors, SignalError, StepErrors, errors_of_record
from bsa.core.inference.prediction import Prediction
from bsa.core.simulation import ExperimentRun
from bsa.experiments.report.records import error_rows
from bsa_toy_cell import toy_task
from bsa_toy_life import fading_task, life


def test_the_errors_of_a_life_say_over_what_they_are() -> None:
    task = fading_task()
    (later,) = task.held_out
    few = replace(later, target=later.target, detailed_cycles=later.detailed_cycles[:2])
    errors = errors_of_record(task, few, ExperimentRun(life(100, 0.1)))
    voltage, capacity = error_rows(replace(task, held_out=(few,)), [errors])
    first, second = few.detailed_cycles
    assert voltage.signal == "voltage"
    assert voltage.line.endswith(
        f"; over the steps of cycles {first}, {second}, each stretched to its measured duration"
    )
    assert "over 99 % of the time" in voltage.line
    assert "over 99 % of the cycles" in capacity.line
    assert capacity.line.endswith("; in percent of the first one")


def test_the_rows_of_a_record_that_was_not_fitted_have_its_steps() -> None:
    error = SignalError("mV", 1.0, 2.0, 0.9)
    errors = RecordErrors("new", {"voltage": error}, (StepErrors("rest 1", 0.0, 60.0, {"voltage": error}),))
    for at_limit in ((), ((30.0, 60.0),)):
        (row,) = error_rows(toy_task(), (), [Prediction(errors, {}, None, at_limit=at_limit)])
        assert [step.part for step in row.steps] == ["rest 1 (1 min 0 s)"]
        assert row.followed == (not at_limit)
