"""Voltages that are written later than the current."""

import numpy as np
import pytest
from bsa.core.reading.checks import to_record
from bsa.core.reading.lag import shown_lag
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from hypothesis import given
from hypothesis import strategies as st


def drive(lag_s: float, interval_s: float = 1.0, ohm: float = 0.02, seed: int = 0) -> Samples:
    """Twenty minutes of a varying current through a resistance and one that takes 5 s to show; charge positive."""
    time = interval_s * np.arange(1200)
    knots = np.arange(0.0, time[-1] + 4 * interval_s, 3 * interval_s)
    levels = np.random.default_rng(seed).normal(-1.0, 3.0, len(knots))
    slow = np.zeros(len(time))
    current = np.interp(time, knots, levels)
    for k in range(1, len(time)):
        slow[k] = slow[k - 1] + (current[k] - slow[k - 1]) * interval_s / 5.0
    voltage = 3.7 + ohm * np.interp(time - lag_s, knots, levels) + 0.5 * ohm * np.interp(time - lag_s, time, slow)
    return Samples("drive", time, voltage, current)


def said(samples: Samples) -> list[str]:
    return [note for note in to_record(samples, ReadOptions()).notes if "--voltage-lag" in note]


@pytest.mark.slow
@given(st.floats(0.6, 2.5), st.sampled_from([0.1, 1.0]), st.integers(0, 5))
def test_a_lag_of_more_than_half_an_interval_is_found(intervals: float, interval_s: float, seed: int) -> None:
    late = drive(intervals * interval_s, interval_s, seed=seed)
    lag = shown_lag(late)
    assert lag is not None
    assert lag[0] == pytest.approx(intervals * interval_s, abs=0.35 * interval_s)
    (note,) = said(late)
    assert note == lag[1]
    assert f"{lag[0]:.2g} s late" in note


def test_a_lag_that_is_shown_is_taken_back_unless_another_is_given() -> None:
    right, late = to_record(drive(0.0), ReadOptions()).trajectory, drive(1.0)
    taken_back = to_record(late, ReadOptions()).trajectory
    kept = to_record(late, ReadOptions(voltage_lag_s=0.0)).trajectory
    errors_v = [np.sqrt(np.mean((found.voltage - right.voltage)[:-2] ** 2)) for found in (taken_back, kept)]
    assert errors_v[0] < 0.2 * errors_v[1]
    assert kept.voltage == pytest.approx(late.voltage)


def test_a_record_without_a_lag_says_nothing() -> None:
    assert said(drive(0.0)) == []


def test_a_resistor_is_in_step_to_the_last_digit() -> None:
    """With whole numbers of intervals nothing is left of the changes at all; a lag of 2e-15 s was told."""
    current = np.tile([0.0, 5.0, 5.0, 5.0], 300)
    time = np.arange(1200.0) + np.repeat(40.0 * np.arange(24), 50)
    samples = Samples("resistor", time, 3.7 + 0.03 * current, current)
    assert shown_lag(samples) is None
    assert said(samples) == []


def test_a_few_steps_say_nothing_of_a_lag() -> None:
    time = np.arange(0.0, 1200.0, 1.0)
    current = np.where((time > 300) & (time < 900), -1.0, 0.0)
    assert said(Samples("step", time, 3.7 + 0.02 * np.roll(current, 2), current)) == []


def test_the_lag_that_is_given_is_taken_back() -> None:
    mended = to_record(drive(1.0), ReadOptions(voltage_lag_s=1.0))
    right = to_record(drive(0.0), ReadOptions()).trajectory
    assert np.max(np.abs(mended.trajectory.voltage - right.voltage)[:-1]) < 1e-3
    assert any("taken 1 s later" in note for note in mended.notes)


def test_a_clock_of_whole_seconds_may_tick_once_for_two_samples() -> None:
    current = np.tile([1.0, -1.0], 200)
    samples = Samples("a", np.arange(400.0) // 2, 3.7 + 0.05 * current, current)
    assert shown_lag(samples) is None
    assert len(to_record(samples, ReadOptions()).trajectory) == 400
