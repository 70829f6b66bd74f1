import numpy as np
import pytest
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.modelling.drive import CurrentFunction, current_function, one_after_another, pieces_of
from hypothesis import given
from hypothesis import strategies as st

HELD_S = 1800.0


def charged(decay_s, period_s, first_late=True):
    """A charge of 5 A for an hour and a hold in which the current decays, sampled as cyclers do; charge in A.s."""
    hold = np.arange(period_s if first_late else 0.0, HELD_S + 1e-9, period_s)
    time = np.concatenate([np.arange(0.0, 3600.1, 60.0), 3600.0 + hold])
    current = np.concatenate([np.full(61, -5.0), -5.0 * np.exp(-hold / decay_s)])
    voltage = np.concatenate([np.linspace(3.5, 4.2, 61), np.full(len(hold), 4.2)])
    steps = (Step(StepKind.CC_CHARGE, 0, 61), Step(StepKind.CV_HOLD, 61, len(time)))
    return Trajectory(time, current, voltage, None, steps), -5.0 * decay_s * (1 - np.exp(-HELD_S / decay_s))


def charge(time, current):
    return float(np.trapezoid(current, time))


@pytest.mark.parametrize("first_late", [True, False])
@given(decay_s=st.floats(150.0, 2000.0), period_s=st.sampled_from([10.0, 30.0, 60.0]))
def test_a_hold_sampled_once_a_minute_keeps_its_charge(first_late, decay_s, period_s):
    record, true_charge = charged(decay_s, period_s, first_late)
    hold = pieces_of(record)[-1]
    assert hold.kind is StepKind.CV_HOLD
    assert charge(hold.time, hold.current) == pytest.approx(true_charge, rel=1e-3)
    # The first minute belongs to the hold, and began with the charge's own current.
    assert hold.begin == 3600.0
    assert hold.current[0] == pytest.approx(-5.0, rel=1e-2)


def test_the_function_of_time_has_the_charge_of_its_pieces():
    record, true_charge = charged(300.0, 60.0)
    drive = current_function(record)
    inside = (drive.time >= 0) & (drive.time <= 3600.0 + HELD_S)
    assert charge(drive.time[inside], drive.current[inside]) == pytest.approx(-5.0 * 3600 + true_charge, rel=1e-4)


def test_a_hold_after_a_rest_begins_with_its_own_first_sample():
    hold = np.arange(60.0, 601.0, 60.0)
    time = np.concatenate([np.arange(0.0, 301.0, 60.0), 300.0 + hold])
    current = np.concatenate([np.zeros(6), -1.0 * np.exp(-hold / 300)])
    steps = (Step(StepKind.REST, 0, 6), Step(StepKind.CV_HOLD, 6, 16))
    piece = pieces_of(Trajectory(time, current, np.full(16, 4.2), None, steps))[-1]
    assert piece.current[0] == pytest.approx(current[6])


def test_a_hold_whose_current_changes_sign_is_followed_as_it_is():
    time = np.arange(0.0, 601.0, 60.0)
    current = np.linspace(-0.5, 0.4, 11)
    piece = pieces_of(Trajectory(time, current, np.full(11, 4.2), None, (Step(StepKind.CV_HOLD, 0, 11),)))[0]
    np.testing.assert_allclose(np.interp(time, piece.time, piece.current), current, atol=1e-9)


def test_a_drive_cycle_logged_ten_times_for_each_command_has_few_knots_and_its_charge():
    commands = np.random.default_rng(3).uniform(-5.0, 15.0, 200)
    time = np.cumsum(np.random.default_rng(4).uniform(0.09, 0.11, 2000))
    current = np.repeat(commands, 10)
    record = Trajectory(time, current, np.full(2000, 3.7), None, (Step(StepKind.DRIVE, 0, 2000),))
    piece = pieces_of(record)[0]
    assert len(piece.time) < 500
    sampled = np.interp(time - time[0], piece.time, piece.current)
    assert np.max(np.abs(sampled - current)) < 2 * 2e-3 * 15.0
    assert charge(piece.time, piece.current) == pytest.approx(charge(time, current), rel=1e-6)


def test_a_single_sample_at_rest_before_the_load_is_at_rest():
    time = np.concatenate([[0.0], np.arange(0.002, 600.0, 10.0)])
    current = np.concatenate([[0.0], np.full(len(time) - 1, 10.0)])
    steps = (Step(StepKind.REST, 0, 1), Step(StepKind.CC_DISCHARGE, 1, len(time)))
    drive = current_function(Trajectory(time, current, np.linspace(4.18, 2.6, len(time)), None, steps))
    np.testing.assert_allclose(np.interp(time, drive.time, drive.current), current)
    assert drive.stops[0] == 0.0


def test_knots_a_rounding_error_apart_stay_in_order_behind_a_long_record():
    first = CurrentFunction(np.array([0.0, 1e5]), np.array([5.0, 5.0]), np.empty(0), None)
    close = np.array([0.0, 1.0, np.nextafter(1.0, 2.0), 2.0])
    joined, delays = one_after_another([first, CurrentFunction(close, np.arange(4.0), np.empty(0), None)])
    assert np.all(np.diff(joined.time) > 0)
    assert np.interp([1.5, 2.0], joined.time - delays[1], joined.current) == pytest.approx([2.5, 3.0])
