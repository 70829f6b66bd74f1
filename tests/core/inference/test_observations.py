from dataclasses import replace

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.inference.observations import observe, subset
from bsa.core.trajectory import Step, StepKind, Trajectory
from hypothesis import given
from hypothesis import strategies as st


def emptying(duration=3600.0, period=30.0, cycles=1, logged_twice=False) -> Trajectory:
    """Discharges that end in a knee, each followed by a rest; the end of a discharge may be logged twice."""
    time, current, voltage, steps = [], [], [], []
    for number in range(cycles):
        start, first = number * 2 * duration, sum(map(len, time))
        clock = np.arange(period, duration + 1, period)
        if logged_twice:
            clock = np.append(clock, clock[-1])
        time += [start + clock, start + duration + clock[: len(clock) // 2]]
        current += [np.ones(len(clock)), np.zeros(len(clock) // 2)]
        voltage += [knee(clock, duration), np.full(len(clock) // 2, 3.4)]
        middle, last = first + len(clock), first + len(clock) + len(clock) // 2
        steps.append(Step(StepKind.CC_DISCHARGE, first, middle, number + 1))
        steps.append(Step(StepKind.REST, middle, last, number + 1))
    return Trajectory(*map(np.concatenate, (time, current, voltage)), None, tuple(steps))


def knee(clock, duration=3600.0):
    return 3.7 - 0.3 * clock / duration - 0.6 * np.exp((clock - duration) / 150.0)


def test_a_simulation_is_averaged_as_the_record_is():
    record = emptying(cycles=20)
    observed = observe(MeasuredRecord("x", record), points=300)

    def simulated(time):
        within = np.mod(time, 7200.0)
        return np.where(within <= 3600.0, knee(within), 3.4)

    discharge = observed.step % 2 == 0
    in_the_middle = observed.voltage - simulated(observed.time)
    averaged = observed.voltage - observed.moments.averaged(simulated(observed.moments.time))
    assert np.max(np.abs(in_the_middle[discharge])) > 0.02
    assert np.max(np.abs(averaged[discharge])) < 0.002


@pytest.mark.slow
@given(st.integers(12, 300), st.integers(1, 8))
def test_moments_stand_for_every_sample_once(points, cycles):
    record = emptying(cycles=cycles)
    observed = observe(MeasuredRecord("x", record), points=points)
    assert observed.moments.averaged(np.ones(len(observed.moments.time))) == pytest.approx(np.ones(len(observed)))
    assert observed.moments.averaged(observed.moments.current) == pytest.approx(observed.current)
    assert np.all(np.diff(observed.moments.stretch) >= 0)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
def test_a_subset_keeps_its_own_moments(seed):
    observed = observe(MeasuredRecord("x", emptying(cycles=3)), points=60)
    mask = np.random.default_rng(seed).random(len(observed)) < 0.5
    mask[0] = True
    part = subset(observed, mask)
    assert part.moments.averaged(part.moments.time) == pytest.approx(
        observed.moments.averaged(observed.moments.time)[mask]
    )


@pytest.mark.parametrize("logged_twice", [False, True])
def test_a_knee_counts_less_however_often_its_end_is_logged(logged_twice):
    observed = observe(MeasuredRecord("x", emptying(logged_twice=logged_twice)), points=100)
    discharge = np.flatnonzero(observed.step == 0)
    assert observed.sigma[discharge[-1]] > 10 * np.median(observed.sigma[discharge])


def test_a_varying_current_is_no_knee():
    """Its samples differ by their currents: voltage over charge, from one to the next, gave deviations of a volt."""
    time, rng = np.arange(1800.0), np.random.default_rng(0)
    current = np.repeat(rng.normal(1.0, 1.0, 180), 10)
    drawn = np.cumsum(current) / 3600.0
    voltage = 4.0 - 0.3 * drawn - 0.05 * current + rng.normal(0.0, 5e-4, 1800)
    drive = (Step(StepKind.DRIVE, 0, 1800, 1),)
    usual = observe(MeasuredRecord("drive", Trajectory(time, current, voltage, None, drive)), points=300)
    assert np.max(usual.sigma) < 0.01
    empty = voltage - np.exp((drawn - drawn[-1]) / 0.02)
    knee = observe(MeasuredRecord("drive", Trajectory(time, current, empty, None, drive)), points=300)
    assert np.median(knee.sigma[-5:]) > 5 * np.median(usual.sigma)


@pytest.mark.parametrize("kind", [StepKind.REST, StepKind.DRIVE])
def test_samples_that_no_instrument_took_are_not_observed(kind):
    record = emptying()
    first = record.steps[1].start
    steps = (record.steps[0], replace(record.steps[1], kind=kind))
    put_in = replace(record, steps=steps, inserted=np.arange(len(record)) == first)
    found = observe(MeasuredRecord("x", put_in), points=1000)
    assert np.sum(found.count) == len(record) - 1
    assert record.time[first] not in found.time
