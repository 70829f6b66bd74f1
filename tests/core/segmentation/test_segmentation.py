"""Records made from known steps are cut where they were made."""

from __future__ import annotations

import time as clock
from dataclasses import dataclass

import numpy as np
import pytest
from bsa.core.segmentation import segment
from bsa.core.trajectory import FloatArray, StepKind, Trajectory
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

REST, CHARGE, HOLD, DISCHARGE, PULSE, DRIVE = (
    StepKind.REST,
    StepKind.CC_CHARGE,
    StepKind.CV_HOLD,
    StepKind.CC_DISCHARGE,
    StepKind.PULSE,
    StepKind.DRIVE,
)

CAPACITY_AH = 5.0
RESISTANCE_OHM = 0.03
HOLD_V = 4.2


@dataclass
class Bench:
    """A cell that is a straight open-circuit voltage behind a resistance, and a cycler that logs it."""

    spacing: float
    offset: float = 0.0
    charge_ah: float = 4.0

    def __post_init__(self) -> None:
        self.time: list[FloatArray] = []
        self.current: list[FloatArray] = []
        self.voltage: list[FloatArray] = []
        self.cuts: list[float] = []
        self.kinds: list[StepKind] = []
        self.now = 0.0

    def run(self, kind: StepKind, seconds: float, current: FloatArray | float, spacing: float | None = None) -> Bench:
        spacing = spacing or self.spacing
        t = np.arange(self.offset, seconds, spacing)
        if len(t) == 0:
            t = np.array([0.0])
        wave = np.interp(t, np.linspace(0, seconds, np.size(current)), np.atleast_1d(current))
        drawn = np.concatenate([[0.0], np.cumsum(wave[:-1] * np.diff(t))]) / 3600
        open_circuit = 3.0 + 1.2 * (self.charge_ah - drawn) / CAPACITY_AH
        voltage = np.full(len(t), HOLD_V) if kind is HOLD else open_circuit - RESISTANCE_OHM * wave
        self.charge_ah -= float(np.mean(wave)) * seconds / 3600
        self.time.append(self.now + t)
        self.current.append(wave)
        self.voltage.append(voltage)
        self.cuts.append(self.now)
        self.kinds.append(kind)
        self.now += seconds
        return self

    def rest(self, seconds: float = 1800) -> Bench:
        return self.run(REST, seconds, 0.0)

    def cccv(self, rate: float, seconds: float = 3600, tau: float = 900) -> Bench:
        level = rate * CAPACITY_AH
        # The open-circuit voltage is set so that the charge ends where the hold begins.
        self.charge_ah = (HOLD_V - level * RESISTANCE_OHM - 3.0) / 1.2 * CAPACITY_AH - level * seconds / 3600
        self.run(CHARGE, seconds, -level)
        t = np.linspace(0, 3 * tau, 2000)
        self.run(HOLD, 3 * tau, -level * np.exp(-t / tau))
        self.charge_ah = 4.9
        return self

    def discharge(self, rate: float, seconds: float = 3000) -> Bench:
        return self.run(DISCHARGE, seconds, rate * CAPACITY_AH)

    def pulse(self, rate: float, seconds: float = 10) -> Bench:
        return self.run(PULSE, seconds, rate * CAPACITY_AH, spacing=min(self.spacing, seconds))

    def drive(self, seconds: float, seed: int) -> Bench:
        knots = np.random.default_rng(seed).uniform(-0.8, 2.0, max(20, int(seconds / 10))) * CAPACITY_AH
        return self.run(DRIVE, seconds, knots)

    def record(self, noise: float = 0.0, seed: int = 0) -> Trajectory:
        rng = np.random.default_rng(seed)
        current = np.concatenate(self.current)
        voltage = np.concatenate(self.voltage)
        return Trajectory(
            np.concatenate(self.time),
            current + noise * CAPACITY_AH * rng.standard_normal(len(current)),
            voltage + 0.1 * noise * rng.standard_normal(len(voltage)),
        )


def kinds(trajectory: Trajectory) -> list[StepKind]:
    return [step.kind for step in trajectory.steps]


def assert_covers(trajectory: Trajectory) -> None:
    assert trajectory.steps[0].start == 0
    assert trajectory.steps[-1].stop == len(trajectory)
    for one, two in zip(trajectory.steps[:-1], trajectory.steps[1:], strict=True):
        assert one.stop == two.start
        assert one.cycle in (two.cycle, two.cycle - 1)
    assert all(step.stop > step.start for step in trajectory.steps)
    assert trajectory.steps[0].cycle == 1
    for number in trajectory.cycles:
        places = [step.position for step in trajectory.steps if step.cycle == number]
        assert places == list(range(len(places)))


spacings = st.sampled_from([1.0, 2.0, 5.0, 10.0, 30.0, 60.0])
noises = st.sampled_from([0.0, 1e-4, 1e-3])
relaxed = settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])


@relaxed
@given(
    spacing=spacings,
    noise=noises,
    charge=st.floats(0.3, 1.0),
    rate=st.floats(0.2, 2.0),
    offset=st.sampled_from([0.0, 0.5, 0.9]),
    seed=st.integers(0, 1000),
)
# The current at the end of the second hold is not much above its noise.
@example(spacing=5.0, noise=1e-3, charge=0.625, rate=1.0, offset=0.0, seed=546)
def test_cccv_cycles_are_cut_where_they_were_made(spacing, noise, charge, rate, offset, seed):
    bench = Bench(spacing, offset=offset * spacing)
    for _ in range(2):
        bench.cccv(charge).rest().discharge(rate).rest()
    cut = segment(bench.record(noise, seed))
    assert_covers(cut)
    assert kinds(cut) == bench.kinds
    assert [step.cycle for step in cut.steps] == [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]
    for step, made in zip(cut.steps, bench.cuts, strict=True):
        # The beginning of a hold is soft: the current leaves its plateau slowly.
        slack = 60.0 if step.kind is HOLD else 0.0
        assert abs(cut.time[step.start] - made) <= 2 * spacing + slack


@pytest.mark.slow
@relaxed
@given(spacing=st.sampled_from([0.1, 1.0, 2.0, 5.0, 10.0]), noise=noises, seed=st.integers(0, 1000))
def test_pulses_are_kept_apart(spacing, noise, seed):
    bench = Bench(spacing)
    bench.rest()
    for _ in range(5):
        bench.pulse(1.0).rest(40).pulse(-0.75).rest(600).discharge(0.5, 700).rest(3600)
    cut = segment(bench.record(noise, seed))
    assert_covers(cut)
    assert kinds(cut) == bench.kinds
    assert cut.cycles == (1,)


@relaxed
@given(spacing=st.sampled_from([1.0, 5.0, 10.0, 30.0, 60.0]), noise=noises, seed=st.integers(0, 1000))
def test_a_drive_cycle_is_one_step(spacing, noise, seed):
    bench = Bench(spacing).cccv(0.5).rest().drive(3600, seed).rest()
    cut = segment(bench.record(noise, seed))
    assert_covers(cut)
    found = kinds(cut)
    assert found[:3] == [CHARGE, HOLD, REST]
    assert found[-1] is REST
    assert found.count(DRIVE) == 1
    # Where the drive begins or ends near zero current the rest beside it may take a few samples.
    drive = next(step for step in cut.steps if step.kind is DRIVE)
    assert cut.time[drive.stop - 1] - cut.time[drive.start] > 0.8 * 3600


@pytest.mark.slow
@relaxed
@given(seed=st.integers(0, 1000), noise=noises)
def test_the_sampling_does_not_change_the_kinds(seed, noise):
    rng = np.random.default_rng(seed)
    order = rng.permutation(["cccv", "discharge", "slow", "cccv"])
    results = []
    for spacing in (1.0, 7.0, 30.0, 60.0):
        bench = Bench(spacing).rest()
        for what in order:
            if what == "cccv":
                bench.cccv(0.5)
            else:
                bench.discharge(1.0 if what == "discharge" else 0.1)
            bench.rest()
        results.append(kinds(segment(bench.record(noise, seed))))
        assert results[-1] == bench.kinds
    assert all(result == results[0] for result in results)


@relaxed
@given(
    samples=st.lists(
        st.tuples(st.floats(0, 1000), st.floats(-10, 10), st.floats(2, 4.5)),
        min_size=1,
        max_size=200,
    )
)
def test_any_record_is_covered(samples):
    gaps, current, voltage = (np.array(column) for column in zip(*samples, strict=True))
    assert_covers(segment(Trajectory(np.cumsum(gaps), current, voltage)))


@relaxed
@given(levels=st.lists(st.sampled_from([-5.0, -1.0, 0.0, 0.01, 2.0, 2.01, 5.0]), min_size=1, max_size=300))
def test_any_row_of_levels_is_covered(levels):
    current = np.array(levels)
    assert_covers(segment(Trajectory(np.arange(len(levels)) * 10.0, current, 3.7 - 0.03 * current)))


def test_an_empty_record_has_no_steps():
    assert segment(Trajectory(np.array([]), np.array([]), np.array([]))).steps == ()


def test_a_long_rest_with_noise_is_one_rest():
    rng = np.random.default_rng(1)
    time = np.arange(0, 7200, 5.0)
    cut = segment(Trajectory(time, 1e-4 * rng.standard_normal(len(time)), 3.7 + 1e-4 * rng.standard_normal(len(time))))
    assert kinds(cut) == [REST]


def test_a_lone_discharge_without_rest_is_constant_current():
    time = np.arange(0, 3000, 10.0)
    cut = segment(Trajectory(time, np.full(len(time), 5.0), np.linspace(4.1, 2.7, len(time))))
    assert kinds(cut) == [DISCHARGE]


def test_a_record_that_begins_with_a_discharge_counts_discharges():
    bench = Bench(10.0).discharge(1.0).rest().cccv(0.5).rest().discharge(1.0).rest().cccv(0.5)
    cut = segment(bench.record())
    assert [step.cycle for step in cut.steps] == [1, 1, 1, 1, 1, 2, 2, 2, 2]


def test_a_pulse_of_one_sample_is_a_pulse():
    bench = Bench(10.0).rest()
    bench.pulse(2.0).rest()
    assert kinds(segment(bench.record())) == [REST, PULSE, REST]


def test_a_logging_glitch_does_not_cut_a_discharge():
    record = Bench(10.0).rest().discharge(1.0).rest().record()
    current = record.current.copy()
    current[250] = 0.0
    assert kinds(segment(Trajectory(record.time, current, record.voltage))) == [REST, DISCHARGE, REST]


def test_the_average_sample_at_a_switch_joins_the_step():
    record = Bench(10.0).rest().discharge(1.0).rest().record()
    current = record.current.copy()
    current[180] = 2.3
    current[479] = 3.1
    cut = segment(Trajectory(record.time, current, record.voltage))
    assert kinds(cut) == [REST, DISCHARGE, REST]
    assert (cut.steps[1].start, cut.steps[1].stop) == (180, 480)


def test_two_currents_of_one_sign_are_two_steps():
    bench = Bench(10.0).discharge(1.0, 1200).discharge(0.5, 1200).rest()
    cut = segment(bench.record(1e-3))
    assert kinds(cut) == [DISCHARGE, DISCHARGE, REST]
    assert cut.steps[1].start == 120


def test_a_constant_power_discharge_is_driven():
    time = np.arange(0, 3000, 5.0)
    voltage = np.linspace(4.1, 2.7, len(time))
    cut = segment(Trajectory(time, 15.0 / voltage, voltage))
    assert kinds(cut) == [DRIVE]


def test_a_gap_does_not_turn_a_pulse_into_a_step():
    time = np.concatenate([np.arange(0, 600, 10.0), 600 + np.arange(0, 10.0), 90000 + np.arange(0, 600, 10.0)])
    current = np.concatenate([np.zeros(60), np.full(10, 5.0), np.zeros(60)])
    assert kinds(segment(Trajectory(time, current, 3.7 - 0.03 * current))) == [REST, PULSE, REST]


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["drive", "cccv", "noise"])
def test_the_time_grows_no_faster_than_the_record(shape):
    def seconds(hours: int) -> float:
        bench = Bench(1.0)
        if shape == "drive":
            bench.rest().drive(3600 * hours, 3).rest()
        elif shape == "cccv":
            for _ in range(hours):
                bench.cccv(1.0, 1800, 600).discharge(1.0, 1800)
        else:
            rng = np.random.default_rng(0)
            bench.run(DRIVE, 3600 * hours, rng.standard_normal(3600 * hours))
        record = bench.record(1e-3)
        begin = clock.process_time()
        segment(record)
        return clock.process_time() - begin

    small, large = min(seconds(5) for _ in range(3)), seconds(40)
    # Eight times the samples; quadratic growth would take 64 times as long.
    assert large < 30 * max(small, 0.005)


def test_a_short_hold_behind_a_long_step_is_one_wherever_the_cycler_numbers_begin() -> None:
    current = np.full(16, 0.25)
    current[10] = 0.5
    record = Trajectory(12.0 * np.arange(16), current, 3.7 - 0.03 * current)
    numbers = np.repeat([1.0, 2.0], [10, 6])
    kinds = [step.kind for step in segment(record).steps]
    assert kinds == [StepKind.CC_DISCHARGE, StepKind.CV_HOLD]
    assert [step.kind for step in segment(record, numbers).steps] == kinds


def test_a_sample_without_a_step_number_is_of_the_step_before() -> None:
    numbers = np.repeat([1.0, 2.0], 20)
    record = Trajectory(np.arange(40.0), np.full(40, 1.0), np.linspace(4.0, 3.9, 40))
    known = segment(record, numbers).steps
    numbers[[0, 19]] = np.nan
    assert segment(record, numbers).steps == known
    assert [step.start for step in known] == [0, 20]


def _wobbling(ohm: float, seed: int = 1) -> Trajectory:
    """A discharge of ten hours whose current varies by up to a third in bursts of some minutes, before a resistance."""
    rng, count = np.random.default_rng(seed), 3600
    smooth = np.convolve(rng.standard_normal(count + 20), np.hanning(21) / np.hanning(21).sum(), "valid")
    bursts = np.repeat(rng.random(count // 60) < 0.25, 60)
    bursts[:60] = bursts[-60:] = False
    current = 1.0 + np.where(bursts, 0.5 * smooth, 1e-3 * rng.standard_normal(count))
    time = 10.0 * np.arange(count)
    return Trajectory(time, current, 4.2 - 1e-3 * time / 36.0 - ohm * current + 1e-4 * rng.standard_normal(count))


@pytest.mark.parametrize("seed", range(3))
def test_a_current_that_wobbles_without_an_answer_is_constant(seed):
    assert [step.kind for step in segment(_wobbling(0.0, seed)).steps] == [StepKind.CC_DISCHARGE]


def test_a_current_that_a_cell_answers_is_driven():
    assert StepKind.DRIVE in {step.kind for step in segment(_wobbling(0.1)).steps}


def test_a_hold_behind_a_charge_is_no_wobble():
    """The voltage does not answer there either."""
    time = 20.0 * np.arange(600)
    current = -np.where(np.arange(600) < 400, 1.0, np.exp(-(np.arange(600) - 399) / 60.0))
    record = Trajectory(time, current, np.minimum(3.6 + 1.5e-3 * np.arange(600), 4.2))
    assert [step.kind for step in segment(record).steps] == [StepKind.CC_CHARGE, StepKind.CV_HOLD]


def test_a_current_that_is_ramped_up_belongs_to_the_step_that_it_leads_to() -> None:
    """Arbin's cyclers take ten samples within the second in which they switch a large current on."""
    bench = Bench(5.0).rest(600)
    for _ in range(2):
        bench.run(DISCHARGE, 0.7, np.linspace(0.5, 4.0, 10), spacing=0.07).discharge(0.88, 300).rest(600)
    assert kinds(segment(bench.record())) == [REST, DISCHARGE, REST, DISCHARGE, REST]


def test_a_ramp_takes_no_step_away_that_lasts() -> None:
    bench = Bench(5.0).rest(600)
    for current in (1.0, 2.0, 3.0):
        bench.run(DISCHARGE, 30, current)
    found = segment(bench.discharge(0.8).record())
    assert len(found.steps) == 5
    assert found.time[found.steps[-1].start] == 690.0


def test_the_end_of_a_hold_that_is_read_in_coarse_numbers_is_still_the_hold() -> None:
    """Of a cell that was charged at 33 A, an instrument of 0.035 A reads 0.25 to 0.4 A."""
    bench = Bench(5.0).cccv(1.0).rest(600)
    bench.cccv(6.6, seconds=400, tau=250).rest(600)
    record = bench.record()
    coarse = np.round(record.current / 0.035) * 0.035
    more = 0.035 * np.sign(coarse) * (np.arange(len(coarse)) % 3 == 0)
    wobbling = coarse + np.where(np.abs(coarse) < 2.0, more, 0.0)
    found = segment(record.changed(current=wobbling))
    assert kinds(found) == [CHARGE, HOLD, REST, CHARGE, HOLD, REST]
