from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.inference.current_offset import current_offset
from bsa.core.inference.observations import observe
from bsa.core.inference.problem import Problem
from bsa.core.taper import hidden_charge
from bsa.core.target import CurrentOffset, change_of
from bsa.core.trajectory import StepKind


def many_cycles(offset: float = 0.0) -> MeasuredRecord:
    """Ten cycles whose voltage is that of a current which is larger than the recorded one by ``offset``, A."""
    made = toy.measured_record("many", np.random.default_rng(0), {}, program=toy.CYCLE, cycles=10)
    record = made.record
    voltage = record.voltage - 0.2 * offset * record.time / 3600.0
    return replace(made, record=record.changed(voltage=voltage))


def test_a_record_of_many_cycles_has_what_rounding_hides_of_its_current():
    made = many_cycles()
    read = np.round(made.record.current * (1.0 - 1e-5 * np.arange(len(made.record))), 3)
    offset = current_offset(replace(made, record=made.record.changed(current=read)))
    assert offset is not None
    assert (offset.name, offset.unit, offset.target) == ("Current offset: many [A]", "A", CurrentOffset("many"))
    assert offset.prior
    assert offset.deviation == pytest.approx(0.001 / np.sqrt(12.0))
    assert change_of({offset.name: offset.target}, {offset.name: 2e-4}).current_offset == {"many": 2e-4}


def test_a_current_that_is_one_number_is_known_to_three_digits_and_a_finely_read_one_needs_no_offset():
    made = many_cycles()
    assert current_offset(made).deviation == pytest.approx(3e-4)
    read = made.record.current * (1.0 + 1e-7 * np.arange(len(made.record)))
    assert current_offset(replace(made, record=made.record.changed(current=read))) is None


def test_a_finely_read_current_has_what_the_samples_of_its_voltage_holds_hide():
    made = many_cycles()
    time, current = made.record.time, made.record.current * (1.0 + 1e-7 * np.arange(len(made.record)))
    hold = next(step for step in made.record.steps if step.kind is StepKind.CC_CHARGE)
    since = time[hold.start : hold.stop] - time[hold.start]
    current[hold.start : hold.stop] = current[hold.start] * np.exp(-5.0 * np.sqrt(since / since[-1]))
    steps = tuple(replace(step, kind=StepKind.CV_HOLD) if step == hold else step for step in made.record.steps)
    record = replace(made.record.changed(current=current), steps=steps)
    offset = current_offset(replace(made, record=record))
    assert offset.deviation == pytest.approx(hidden_charge(record) / record.duration, rel=1e-3)
    assert offset.prior


def test_a_record_of_few_cycles_has_none():
    assert current_offset(toy.measured_record("few", np.random.default_rng(0), {})) is None


def test_an_offset_of_a_hold_out_record_is_no_error_of_the_model():
    few = observe(toy.measured_record("few", np.random.default_rng(1), {}), points=150)
    rms = []
    for offset in (0.0, 6e-4):
        problem = Problem(toy.ToySimulator(), [few], [observe(many_cycles(offset), points=150)])
        ((_, error),) = problem.held_out((), {"resistance factor": 1.2, few.measured_record.soc_name: 0.9})
        rms.append(float(np.sqrt(np.mean(error**2))))
    assert rms[1] == pytest.approx(rms[0], rel=0.1)


def test_what_acts_on_one_record_leaves_the_simulation_of_another_the_same():
    problem, space = toy.problem(np.random.default_rng(0), {})
    asked = []
    predict = problem.simulator.predict
    problem.simulator.predict = lambda requests: (
        asked.extend(request.identity for request in requests) or predict(requests)
    )
    here = space.at(np.zeros(len(space)))
    problem.predict((), here)
    problem.predict((), here | {"Initial state of charge: b": 0.7})
    problem.predict((), here | {"Current offset: a [A]": 1e-4})
    a, b = asked[::2], asked[1::2]
    assert a[0] == a[1] != a[2]
    assert b[0] == b[2] != b[1]
