from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.noise import noise_freedom, noise_of, resolution, rounding_that_stays
from bsa.core.trajectory import Step, StepKind, Trajectory
from hypothesis import given, settings
from hypothesis import strategies as st


def record(voltage: np.ndarray, spacing_s: float, kind: StepKind = StepKind.CC_DISCHARGE) -> Trajectory:
    time = spacing_s * np.arange(len(voltage))
    return Trajectory(time, np.ones_like(time), voltage, None, (Step(kind, 0, len(time)),))


def bending(count: int) -> np.ndarray:
    place = np.linspace(0.0, 1.0, count)
    return 4.1 - 0.3 * place - 0.4 * place**6


@settings(max_examples=20)
@given(st.floats(1e-4, 3e-3), st.integers(0, 1000), st.integers(2, 4))
def test_every_order_of_differences_tells_the_same_noise(noise: float, seed: int, order: int) -> None:
    voltage = bending(900) + np.random.default_rng(seed).normal(0.0, noise, 900)
    made = record(voltage, 4.0)
    assert noise_of(made, made.voltage, order) == pytest.approx(noise, rel=0.2)


def test_higher_orders_see_less_of_a_coarsely_sampled_curve() -> None:
    made = record(bending(60), 60.0)
    second, fourth = (noise_of(made, made.voltage, order) for order in (2, 4))
    assert second is not None
    assert fourth is not None
    assert fourth < 0.2 * second


def test_a_drive_cycle_tells_no_noise() -> None:
    noisy = bending(900) + np.random.default_rng(0).normal(0.0, 1e-3, 900)
    drive = record(noisy, 1.0, StepKind.DRIVE)
    assert noise_of(drive, drive.voltage) is None
    assert noise_freedom(drive) == np.inf
    beside = replace(drive, steps=(Step(StepKind.DRIVE, 0, 600), Step(StepKind.REST, 600, 900)))
    rough = np.where(np.arange(900) < 600, 0.1 * np.sin(np.arange(900) ** 2), 0.0)
    assert noise_of(beside, noisy + rough) == pytest.approx(1e-3, rel=0.2)


def test_rounding_counts_as_noise() -> None:
    made = record(np.round(bending(900), 3), 4.0)
    found = noise_of(made, made.voltage)
    assert found is not None
    assert found >= 1e-3 / np.sqrt(12)


@pytest.mark.parametrize("noise", [1e-3, 2e-3, 3e-3, 6e-3])
def test_rounded_readings_tell_their_noise_too(noise: float) -> None:
    step = 3e-3
    voltage = bending(900) + np.random.default_rng(2).normal(0.0, noise, 900)
    made = record(step * np.round(voltage / step), 4.0)
    assert noise_of(made, made.voltage) == pytest.approx(np.hypot(noise, step / np.sqrt(12.0)), rel=0.12)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.4, 1.0])
def test_rounding_errors_that_noise_does_not_blur_stay_in_a_mean(noise: float) -> None:
    rng = np.random.default_rng(3)
    true = rng.uniform(0.0, 50.0, 400)
    readings = np.round(true[:, None] + rng.normal(0.0, noise, (400, 2000)))
    seen = np.std(readings.mean(axis=1) - true)
    rounding = 12.0**-0.5
    assert rounding_that_stays(np.hypot(noise, rounding), rounding) == pytest.approx(seen, rel=0.1, abs=0.03)


def test_the_noise_is_as_uncertain_as_its_degrees_of_freedom_say() -> None:
    rng = np.random.default_rng(4)
    made = [record(rng.normal(0.0, 1e-3, 400), 4.0) for _ in range(400)]
    found = np.array([noise_of(one, one.voltage) for one in made])
    assert noise_freedom(made[0]) == pytest.approx(0.5 / np.var(np.log(found)), rel=0.2)
    assert noise_freedom(record(bending(20), 4.0)) == np.inf


def test_a_short_record_and_a_drive_cycle_tell_nothing() -> None:
    short, drive = record(bending(20), 4.0), record(bending(900), 4.0, StepKind.DRIVE)
    assert noise_of(short, short.voltage) is None
    assert noise_of(drive, drive.voltage) is None


def test_a_constant_that_rounding_moves_has_no_resolution() -> None:
    values = np.full(120, 298.15)
    values[::3] = np.nextafter(298.15, 400.0)
    assert resolution(values) == pytest.approx(1e-6)
