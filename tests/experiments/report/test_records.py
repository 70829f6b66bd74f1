"""The rows that tell the errors of records."""

from dataclasses import replace

from bsa.core.record_errors import errors_of_record
from bsa.core.simulation import ExperimentRun
from bsa.experiments.report.records import error_rows
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
