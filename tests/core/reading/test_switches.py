"""The samples right before and right after a switch of the current, whichever signal is logged first."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.reading.switches import resting_voltage, switches
from bsa.core.record import ReadOptions
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
    assert (switch.before, switch.after, switch.early) == (4 - early, 5, bool(early))
    assert resting_voltage(record) == 3.7


def test_what_relaxes_over_a_minute_is_no_step():
    record = pulse(1, rest_s=60.0)
    assert not next(switches(record)).early
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
    assert [(switch.before, switch.early) for switch in second] == [(60, False)]
