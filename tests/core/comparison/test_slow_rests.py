"""Rests in which a measured voltage goes on rising where the simulated one does not."""

import numpy as np
import pytest
from bsa.core.comparison.slow_rests import rises_beyond
from bsa.core.trajectory import Step, StepKind, Trajectory

STEPS = (Step(StepKind.CC_DISCHARGE, 0, 10), Step(StepKind.REST, 10, 111), Step(StepKind.CC_CHARGE, 111, 120))


def rested(seconds: float) -> Trajectory:
    load, rest = np.arange(0.0, 100.0, 10.0), 100.0 + np.linspace(0.0, seconds, 101)
    time = np.concatenate([load, rest, rest[-1] + 10.0 * np.arange(1, 10)])
    return Trajectory(time, np.repeat([1.0, 0.0, -1.0], [10, 101, 9]), np.full(120, 3.0), None, STEPS)


def test_the_first_tenth_of_a_rest_does_not_count() -> None:
    record = rested(3600.0)
    since = np.clip((record.time - 100.0) / 3600.0, 0.0, 1.0)
    assert list(rises_beyond(record, record.time, 0.1 * since)) == pytest.approx([0.09])
    assert list(rises_beyond(record, record.time, 0.1 * np.minimum(since, 0.1))) == pytest.approx([0.0])


def test_a_short_rest_and_one_that_was_not_compared_tell_nothing() -> None:
    record = rested(1700.0)
    assert list(rises_beyond(record, record.time, np.zeros(120))) == []
    assert list(rises_beyond(rested(3600.0), record.time[:10], np.zeros(10))) == []
