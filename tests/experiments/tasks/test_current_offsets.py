"""The offset of the current of records that do not bring their charge back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.feedback import Feedback
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions, Record
from bsa.core.target import CurrentOffset, target_named
from bsa.core.trial import Trial
from bsa.experiments.file_reading import FileReading
from bsa.experiments.run_record import RunRecord
from bsa.experiments.tasks.current_offsets import searched_offset, without_current_offset
from bsa.experiments.tasks.measured_cell import CellRequest
from bsa.experiments.tasks.parameter_source import with_its_space
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import build_task

OFFSET_A = 0.02  # What the instrument adds, positive on discharge.


def there_and_back(offset_a: float = OFFSET_A) -> Record:
    """A discharge and a charge at 0.25 A for 20 h between rests, as an instrument with an offset writes them."""
    time = np.arange(0.0, 44 * 3600.0, 300.0)
    hours = time / 3600.0
    true = np.select([(hours >= 1) & (hours < 21), (hours >= 22) & (hours < 42)], [0.25, -0.25], 0.0)
    drawn = np.cumsum(true) * 300.0 / 3600.0
    written = np.where(true == 0.0, 0.0, true + offset_a)
    return to_record(Samples("slow", time, 4.15 - 0.12 * drawn - 0.05 * true, -written), ReadOptions())


def request(offset_a: float | None = None) -> RecordRequest:
    return RecordRequest(there_and_back(), FileReading(ReadOptions(current_offset_a=offset_a)))


def test_an_offset_that_nobody_named_is_taken_off_and_its_rest_is_searched() -> None:
    found = without_current_offset(request(), there_and_back())
    assert found.trajectory.discharge_capacity[-1] == pytest.approx(0.0, abs=1e-3)
    assert found.trajectory.current[0] == 0.0
    assert "an offset of -20 mA (positive on charge) is taken off" in found.notes[-1]
    searched = searched_offset(request(), "slow")
    assert searched is not None
    assert searched.target == CurrentOffset("slow") == target_named(searched.name)
    assert (searched.initial, searched.prior) == (0.0, True)
    assert searched.deviation == pytest.approx(0.5 * OFFSET_A, rel=0.01)
    # From no offset to twice the offset.
    assert (searched.lower, searched.upper) == pytest.approx((-OFFSET_A, OFFSET_A), rel=0.01)


@pytest.mark.parametrize(
    "asked",
    [request(0.0), request(-0.01), replace(request(), protocol=(("Rest for 1 hour",),))],
    ids=["kept as it is", "given", "under a protocol"],
)
def test_what_a_person_says_of_the_current_is_kept(asked: RecordRequest) -> None:
    whole = there_and_back()
    assert without_current_offset(asked, whole) is whole
    assert searched_offset(asked, "slow") is None


def test_a_record_that_brings_its_charge_back_has_no_offset() -> None:
    sound = there_and_back(0.0)
    assert without_current_offset(RecordRequest(sound), sound) is sound
    assert searched_offset(RecordRequest(sound), "slow") is None


def test_a_task_searches_the_offset_where_its_parameters_have_priors() -> None:
    with_priors = build_task("t", CellRequest("Chen2020", "SPM", search="cell"), [request()])
    assert CurrentOffset("slow") in with_priors.space.targets.values()
    (experiment,) = with_priors.experiments
    assert experiment.target.discharge_capacity[-1] == pytest.approx(0.0, abs=1e-3)
    assert any("is taken off the current" in note for note in with_priors.notes)
    space = {"Negative particle radius [m]": {"lower": 1e-6, "upper": 1e-5}}
    without = build_task("t", CellRequest("Chen2020", "SPM", search=space), [request()])
    assert CurrentOffset("slow") not in without.space.targets.values()


def test_an_offset_that_a_person_searches_has_the_persons_range() -> None:
    name = "Current offset: slow [A]"
    space = {name: {"lower": -0.001, "upper": 0.002, "deviation": 0.001}}
    task = build_task("t", CellRequest("Chen2020", "SPM", search=space), [request()])
    assert task.space.names.count(name) == 1
    assert (task.space[name].initial, task.space[name].upper) == (0.0, 0.002)


def test_a_run_goes_on_with_the_offset_of_the_same_record_alone() -> None:
    task = build_task("t", CellRequest("Chen2020", "SPM", search="cell"), [request()])
    name = "Current offset: slow [A]"
    best = {parameter.name: parameter.initial for parameter in task.space} | {name: 0.003}
    trial = Trial(0, "initial", 0, best, SignalMetrics(1.0, {}), None, np.ones(3), Feedback({}), (), 0.0)
    run = RunRecord("run", task, {}, {}, "", "finished", (trial,), (), (), trial)
    assert with_its_space(task, run).space[name].initial == 0.003
    sound = replace(there_and_back(0.0), name="sound")
    other = build_task("t", CellRequest("Chen2020", "SPM", search="cell"), [RecordRequest(sound)])
    assert name not in with_its_space(other, run).space
    # A record that the run did not fit has an offset of its own.
    later = replace(request(), source=replace(there_and_back(), name="later"))
    another = build_task("t", CellRequest("Chen2020", "SPM", search="cell"), [later])
    assert with_its_space(another, run).space["Current offset: later [A]"].initial == 0.0
