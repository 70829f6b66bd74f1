import numpy as np
import pytest
from bsa.core.taper import between_samples, from_its_beginning, hidden_charge
from bsa.core.trajectory import Step, StepKind, Trajectory
from hypothesis import given
from hypothesis import strategies as st

HELD_S = 3600.0


def current_at(time):
    """A current that decays in two ways, as that of a hold does: A."""
    return -2.0 * np.exp(-time / 250.0) - 1.0 * np.exp(-time / 1500.0)


CHARGE = -2.0 * 250.0 * (1 - np.exp(-HELD_S / 250.0)) - 1500.0 * (1 - np.exp(-HELD_S / 1500.0))


def held(period_s, times=1):
    """A charge at the current with which each of some holds begins, and these holds, one after the other."""
    hold = np.arange(period_s, HELD_S + 1e-9, period_s)
    charge = np.arange(0.0, 601.0, 60.0)
    time, current, steps = [], [], []
    for place in range(times):
        begin, first = place * (600.0 + HELD_S + 10.0), place * (len(charge) + len(hold))
        time += [begin + charge, begin + 600.0 + hold]
        current += [np.full(len(charge), -3.0), current_at(hold)]
        middle = first + len(charge)
        steps += [Step(StepKind.CC_CHARGE, first, middle), Step(StepKind.CV_HOLD, middle, middle + len(hold))]
    time, current = np.concatenate(time), np.concatenate(current)
    return Trajectory(time, current, np.full(len(time), 4.2), None, tuple(steps))


def test_a_hold_begins_where_the_charge_before_it_ended():
    record = held(60.0)
    time, current = from_its_beginning(record, record.steps[1])
    assert (time[0], current[0]) == (600.0, -3.0)
    assert len(time) == record.steps[1].stop - record.steps[1].start + 1


def test_a_hold_at_the_beginning_of_a_record_has_its_own_samples_only():
    record = held(60.0)
    step = record.steps[1]
    alone = record.picked(slice(step.start, step.stop), (Step(StepKind.CV_HOLD, 0, step.stop - step.start),))
    time, _ = from_its_beginning(alone, alone.steps[0])
    assert time[0] == 660.0


@given(period_s=st.sampled_from([20.0, 30.0, 60.0, 90.0, 180.0]))
def test_the_charge_that_is_said_to_be_hidden_is_at_least_what_is_missed(period_s):
    record = held(period_s)
    time, current = between_samples(*from_its_beginning(record, record.steps[1]))
    missed = abs(float(np.trapezoid(current, time)) - CHARGE)
    assert missed <= hidden_charge(record) <= 30 * missed + 0.1


def test_what_holds_hide_adds_up_and_shrinks_with_the_sampling_interval():
    assert hidden_charge(held(60.0, times=5)) == pytest.approx(5 * hidden_charge(held(60.0)))
    assert hidden_charge(held(10.0)) < 0.2 * hidden_charge(held(60.0))


def test_a_time_that_is_written_twice_and_a_hold_of_one_sample_hide_nothing_more():
    record = held(60.0)
    twice = np.sort(np.append(np.arange(len(record)), 20))
    steps = (record.steps[0], Step(StepKind.CV_HOLD, record.steps[1].start, len(record) + 1))
    assert hidden_charge(record.picked(twice, steps)) == pytest.approx(hidden_charge(record))
    assert hidden_charge(record.picked(slice(0, 1), (Step(StepKind.CV_HOLD, 0, 1),))) == 0.0


def test_a_record_without_a_hold_hides_nothing():
    record = held(60.0)
    assert hidden_charge(record.slice(0, record.steps[0].stop)) == 0.0
