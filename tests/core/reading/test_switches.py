"""The samples right before and right after a switch of the current, whichever signal is logged first."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.reading.switches import mixed_samples_note, resting_voltage, switches, without_mixed_samples
from bsa.core.record import ReadOptions, Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory


def pulse(early: int, rest_s: float = 1.0, rest_samples: int = 5) -> Trajectory:
    """A rest at 3.7 V and a pulse to 3.46 V, whose voltage so many of the last samples at rest have."""
    time = np.concatenate([rest_s * np.arange(rest_samples), rest_s * rest_samples + 0.1 * np.arange(100)])
    current = np.where(np.arange(len(time)) < rest_samples, 0.0, 7.5)
    voltage = np.where(np.arange(len(time)) < rest_samples - early, 3.7, 3.46)
    return segment(Trajectory(time, current, voltage))


@pytest.mark.parametrize("early", [0, 1])
def test_a_rest_ends_before_the_voltage_steps(early):
    record = pulse(early)
    (switch,) = switches(record)
    assert (switch.before, switch.after, switch.mixed) == (4 - early, 5, 4 if early else None)
    assert resting_voltage(record) == 3.7


def loaded(late: int, later_s: float = 1.0) -> Trajectory:
    """A pulse at 3.46 V and a rest at 3.7 V, of which so many of the first samples have the voltage of the pulse."""
    time = np.concatenate([0.1 * np.arange(10), 1.0 + later_s * np.arange(5)])
    current = np.where(np.arange(15) < 10, 7.5, 0.0)
    voltage = np.where(np.arange(15) < 10 + late, 3.46, 3.7)
    return segment(Trajectory(time, current, voltage))


@pytest.mark.parametrize("late", [0, 1])
def test_a_load_ends_when_the_voltage_steps(late):
    (switch,) = switches(loaded(late))
    assert (switch.before, switch.after, switch.mixed) == (9, 10 + late, 10 if late else None)


def test_a_cell_that_takes_a_third_of_its_jump_at_once_and_the_rest_within_seconds_is_no_late_voltage():
    slow = loaded(1)
    voltage = np.where(np.arange(15) == 10, 3.54, slow.voltage)
    assert next(switches(slow.changed(voltage=voltage))).mixed is None
    assert next(switches(loaded(1, later_s=60.0))).mixed is None


@pytest.mark.parametrize(("trajectory", "place", "at_s"), [(pulse(1), 4, "4"), (loaded(1), 10, "1")])
def test_a_sample_of_two_moments_is_left_out_with_a_note(trajectory, place, at_s):
    left = without_mixed_samples(Record("a", trajectory, ("noted",)))
    assert np.flatnonzero(left.trajectory.inserted).tolist() == [place]
    assert left.notes[0] == "noted"
    assert f"(1 sample, the first at {at_s} s)" in left.notes[1]
    assert np.array_equal(left.trajectory.voltage, trajectory.voltage)
    assert without_mixed_samples(left) is left


def test_a_record_without_such_samples_stays_as_it_is():
    record = Record("a", pulse(0), ())
    assert without_mixed_samples(record) is record
    assert mixed_samples_note(record.trajectory) == ""


def test_what_relaxes_over_a_minute_is_no_step():
    record = pulse(1, rest_s=60.0)
    assert next(switches(record)).mixed is None
    assert resting_voltage(record) == 3.46


def test_a_rest_of_one_sample_is_all_that_there_is():
    assert resting_voltage(pulse(1, rest_samples=1)) == 3.46


def test_the_sample_before_is_of_the_same_test():
    # Two charges, each begun at rest: the second begins far below the voltage at which the first one ended.
    time = np.tile(3.0 * np.arange(60), 2)
    current = np.tile(np.where(np.arange(60) < 1, 0.0, np.where(np.arange(60) < 40, 1.5, 0.0)), 2)
    voltage = np.concatenate([np.linspace(3.5, 4.2, 60), [3.4], np.linspace(3.55, 4.2, 59)])
    record = to_record(Samples("a", time, voltage, current), ReadOptions(join=True)).trajectory
    second = [switch for switch in switches(record) if switch.after == 61]
    assert [(switch.before, switch.mixed) for switch in second] == [(60, None)]
