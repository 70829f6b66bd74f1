"""A fit that a low-fidelity model leads: it ends where a fit without one does, in fewer simulations."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from bsa.core.inference.fit_settings import Settings
from bsa.core.inference.least_squares import LeastSquares, solve
from bsa.core.inference.low_fidelity import LowFidelity
from bsa.core.trajectory import FloatArray
from hypothesis import given, settings
from hypothesis import strategies as st

seeds = st.integers(0, 2**32 - 1)

Residuals = Callable[[FloatArray], FloatArray]


def models(seed: int, count: int, error: float, rows: int = 40) -> tuple[Residuals, Residuals, FloatArray]:
    """A non-linear model, one with an error of this size in values and a tenth of it in slopes, and the solution."""
    rng = np.random.default_rng(seed)
    matrix, target = rng.normal(size=(rows, count)), rng.uniform(0.3, 0.7, count)
    shift, tilt, phase = rng.normal(size=rows), rng.normal(size=(rows, count)), rng.uniform(0.0, 6.0, rows)
    at_target = np.sin(1.5 * matrix @ target + phase)

    def full(x: FloatArray) -> FloatArray:
        return 10.0 * (np.sin(1.5 * matrix @ x + phase) - at_target)

    def low(x: FloatArray) -> FloatArray:
        return full(x) + error * (shift + 0.1 * tilt @ x)

    return full, low, target


def led_by(low: Callable[[FloatArray], FloatArray | None], suffices: bool = False) -> tuple[LowFidelity, list[int]]:
    """A low-fidelity model, and how many points it was given, batch by batch."""
    batches: list[int] = []

    def residuals(points: Sequence[FloatArray]) -> list[FloatArray | None]:
        batches.append(len(points))
        return [low(point) for point in points]

    return LowFidelity(residuals, suffices), batches


def fitted(full: Residuals, start: FloatArray, model: LowFidelity | None, budget: int = 150) -> LeastSquares:
    search = LeastSquares(start, full(start), Settings(tolerance=1e-6, enough=1e-4), low_fidelity=model)
    solve(search, lambda points: [full(point) for point in points], budget)
    return search


@given(seeds, st.integers(1, 6), st.floats(0.0, 3.0))
@settings(max_examples=30, deadline=None)
def test_it_agrees_with_the_full_model_where_both_have_simulated(seed: int, count: int, error: float) -> None:
    full, low, target = models(seed, count, error)
    model, _ = led_by(low)
    one, other = target + 0.1, target - 0.05
    assert model.learn(one, full(one))
    assert model.learn(other, full(other))
    for point in (one, other):
        (corrected,) = model.corrected([point])
        assert corrected == pytest.approx(full(point), abs=1e-9)


def test_a_point_is_simulated_once() -> None:
    full, low, target = models(5, 3, 1.0)
    model, batches = led_by(low)
    model.learn(target, full(target))
    model.corrected([target, target + 0.1])
    model.corrected([target + 0.1])
    assert batches == [1, 1]
    assert [point.tolist() for point, _ in model.known] == [(target + 0.1).tolist()]


def test_other_weights_leave_the_model_as_it_is() -> None:
    full, low, target = models(7, 3, 1.0)
    scale = [1.0]
    model = LowFidelity(lambda points: [scale[0] * low(point) for point in points])
    model.learn(target, full(target))
    model.learn(target + 0.1, full(target + 0.1))
    (before,) = model.corrected([target + 0.05])
    scale[0] = 3.0
    model.weigh_anew(3.0)
    (after,) = model.corrected([target + 0.05])
    (new,) = model.corrected([target - 0.05])
    assert before is not None
    assert after == pytest.approx(3.0 * before)
    assert new is not None


@given(seeds, st.integers(2, 6))
@settings(max_examples=15, deadline=None)
def test_a_led_fit_ends_at_the_optimum_in_fewer_simulations(seed: int, count: int) -> None:
    full, low, target = models(seed, count, 1.0)
    start = np.clip(target + 0.05, 0.0, 1.0)
    alone, led = fitted(full, start, None), fitted(full, start, led_by(low)[0])
    assert alone.ending == led.ending == "perfect"
    assert led.simulations < alone.simulations
    assert led.simulations <= 6


@given(seeds, st.sampled_from(["reversed", "failing", "elsewhere"]))
@settings(max_examples=15, deadline=None)
def test_a_low_fidelity_model_that_misleads_costs_simulations_and_not_the_optimum(seed: int, how: str) -> None:
    full, _, target = models(seed, 3, 0.0)
    other, _, _ = models(seed + 1, 3, 0.0)

    def low(x: FloatArray) -> FloatArray | None:
        return {"reversed": -full(x), "failing": None, "elsewhere": other(x)}[how]

    start = target + 0.03
    alone, led = fitted(full, start, None), fitted(full, start, led_by(low)[0])
    assert alone.ending == led.ending == "perfect"
    assert led.simulations <= alone.simulations + 30


@given(seeds, st.integers(1, 5), st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_a_led_fit_stays_in_the_box_and_never_goes_uphill(seed: int, count: int, share_failing: float) -> None:
    full, low, target = models(seed, count, 3.0)
    wall = np.random.default_rng(seed).normal(size=count)
    search = LeastSquares(target, full(target) + 1.0, low_fidelity=led_by(low)[0])
    costs = []
    while (batch := search.ask()) and search.simulations < 60:
        assert all(np.all((point >= 0.0) & (point <= 1.0)) for point in batch)
        search.tell([None if point @ wall > 2.0 * share_failing else full(point) + 1.0 for point in batch])
        costs.append(search.cost)
    assert all(later <= earlier for earlier, later in pairwise(costs))


def test_nothing_is_simulated_before_a_step_is_asked_for() -> None:
    full, low, target = models(11, 3, 1.0)
    model, batches = led_by(low)
    search = LeastSquares(target + 0.05, full(target + 0.05), low_fidelity=model)
    assert search.stage == "low-fidelity"
    assert batches == []
    search.ask()
    assert batches


def test_where_it_suffices_a_fit_ends_without_a_jacobian() -> None:
    full, low, target = models(13, 5, 0.5)
    noisy = np.random.default_rng(1).normal(size=40)

    def measured(x: FloatArray) -> FloatArray:
        return full(x) + noisy

    ended = {}
    for suffices in (True, False):
        search = LeastSquares(
            target + 0.05,
            measured(target + 0.05),
            Settings(noise=1.0),
            low_fidelity=led_by(lambda x: low(x) + noisy, suffices)[0],
        )
        stages = []
        while batch := search.ask():
            stages.append(search.stage)
            search.tell([measured(point) for point in batch])
        ended[suffices] = (search.ending, "jacobian" in stages, search.cost)
    assert ended[True][:2] == ("noise", False)
    assert ended[False][:2] == ("noise", True)
    assert ended[True][2] == pytest.approx(ended[False][2], abs=2.0)


def trapped(x: FloatArray) -> FloatArray:
    """Residuals with a local minimum below 0.22 in the first coordinate, and the solution near 0.45."""
    first = x[0] - 0.45
    hill = 6.0 * np.exp(-(((x[0] - 0.3) / 0.06) ** 2))
    return np.concatenate([10.0 * np.array([first]), [hill], 10.0 * (x[1:] - 0.5)])


@pytest.mark.parametrize("elsewhere", [0.0, 0.2])
def test_from_a_local_minimum_the_low_fidelity_model_begins_elsewhere_too(elsewhere: float) -> None:
    model, _ = led_by(lambda x: trapped(x) + 0.01 * x.sum())
    start = np.array([0.22, 0.5, 0.5])
    settings = Settings(radius=0.3, tolerance=1e-6, enough=1e-4, elsewhere=elsewhere)
    search = LeastSquares(start, trapped(start), settings, low_fidelity=model)
    solve(search, lambda points: [trapped(point) for point in points], 12)
    reached = bool(search.point[0] == pytest.approx(0.45, abs=1e-3))
    assert reached == (elsewhere > 0)


def test_points_elsewhere_lie_in_the_box_and_may_all_fail() -> None:
    start, seen = np.array([0.22, 0.0, 1.0]), []

    def low(points: Sequence[FloatArray]) -> list[FloatArray | None]:
        seen.extend(points)
        return [trapped(point) if np.array_equal(point, start) else None for point in points]

    settings = Settings(radius=0.3, elsewhere=0.2)
    search = LeastSquares(start, trapped(start), settings, low_fidelity=LowFidelity(low))
    solve(search, lambda points: [trapped(point) for point in points], 30)
    assert all(np.all((point >= 0.0) & (point <= 1.0)) for point in seen)
    assert search.ending in {"perfect", "misfit", "no progress"}
