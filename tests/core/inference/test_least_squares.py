from itertools import pairwise

import numpy as np
import pytest
from bsa.core.bounded_step import bounded_step
from bsa.core.errors import BsaError
from bsa.core.inference.differences import Column
from bsa.core.inference.fit_settings import Box, Settings
from bsa.core.inference.least_squares import LeastSquares, solve
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

seeds = st.integers(0, 2**32 - 1)


def linear(seed: int, count: int, rows: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """A matrix and a target whose solution may lie outside the box."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, count)), rng.uniform(-0.3, 1.3, count)


def run(search: LeastSquares, function, limit: int = 300) -> list[np.ndarray]:
    asked: list[np.ndarray] = []
    while (batch := search.ask()) and search.simulations < limit:
        asked += batch
        search.tell([function(point) for point in batch])
    return asked


@given(seeds, st.integers(1, 8))
# Its solution lies beyond the first radius, and the step after that promises less than the usual tolerance.
@example(172, 6)
@settings(max_examples=40)
def test_a_linear_problem_takes_one_jacobian_and_a_few_steps(seed: int, count: int) -> None:
    matrix, target = linear(seed, count)
    search = LeastSquares(np.full(count, 0.5), settings=Settings(radius=1.0, tolerance=1e-6))
    run(search, lambda x: matrix @ (x - target))
    best = 2.0 * lsq_linear(matrix, matrix @ target, bounds=(0, 1), tol=1e-14).cost
    assert search.ending in ("perfect", "noise", "misfit", "no progress")
    assert search.cost <= best * (1 + 1e-6) + 1e-12
    assert search.simulations <= 1 + count + 6


@pytest.mark.slow
@given(seeds, st.integers(1, 6), st.floats(0.0, 0.3), st.floats(0.0, 1.0))
@settings(max_examples=60)
def test_noise_failures_and_curvature_never_lead_out_of_the_box_nor_uphill(
    seed: int, count: int, noise: float, share_failing: float
) -> None:
    matrix, target = linear(seed, count, rows=12)
    rng = np.random.default_rng(seed + 1)
    wall = rng.normal(size=count)

    def function(x: np.ndarray) -> np.ndarray | None:
        if x @ wall > share_failing * 2.0 + 0.5 * wall.sum():
            return None
        return matrix @ np.sin(2 * (x - target)) + noise * np.sin(1e5 * (matrix @ x))

    search = LeastSquares(np.full(count, 0.5))
    costs = []
    while (batch := search.ask()) and search.simulations < 150:
        for point in batch:
            assert np.all(point >= 0.0)
            assert np.all(point <= 1.0)
        search.tell([function(point) for point in batch])
        costs.append(search.cost)
    assert all(later <= earlier for earlier, later in pairwise(costs))


@given(seeds)
@settings(max_examples=20)
def test_directions_that_do_nothing_are_left_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(20, 2)) @ rng.normal(size=(2, 5))  # rank 2 of 5
    target = rng.uniform(0.3, 0.7, 5)
    matrix[:, 3] = 0.0
    search = LeastSquares(np.full(5, 0.5), settings=Settings(tolerance=1e-9))
    run(search, lambda x: matrix @ (x - target))
    assert search.cost < 1e-12
    assert search.point[3] == pytest.approx(0.5, abs=1e-9)
    assert np.max(np.abs(search.point - 0.5)) < 0.5  # combinations that do nothing are not led to a bound


def test_a_curved_valley_is_followed_to_its_end() -> None:
    search = LeastSquares(np.array([0.2, 0.6]))
    run(search, lambda x: np.array([10 * ((4 * x[1] - 2) - (4 * x[0] - 2) ** 2), 1 - (4 * x[0] - 2)]), limit=80)
    assert search.point * 4 - 2 == pytest.approx([1.0, 1.0], abs=1e-4)


def test_a_valley_that_bends_within_a_difference_is_followed_with_closer_ones() -> None:
    def table(x: np.ndarray) -> np.ndarray:
        return np.array([200.0 * (x[1] - x[0] - 0.004 * np.sin(x[0] / 0.012)), x[0] - 0.8, 0.3])

    def gone(closer: float) -> float:
        how = Settings(difference=0.03, radius=np.inf, closer=closer, ends_on_fresh=True, tolerance=2e-3)
        search = LeastSquares(np.array([0.2, 0.21]), settings=how)
        solve(search, lambda points: [table(point) for point in points], budget=400)
        return float(search.point[0])

    assert gone(0.0) < 0.4
    assert gone(0.1) > 0.6


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_central_difference_is_that_of_the_parabola_through_its_points(slope: float, bend: float) -> None:
    def at(x: float) -> np.ndarray:
        return np.array([slope * x + bend * x**2])

    # The other side has less room than a whole step.
    column = Column(0, 0.0, -0.04, 1.0, 0.1, 0.0, 0.0, central=True)
    while column.wanted is not None:
        column.take(at(column.wanted))
    assert column.slope == pytest.approx(slope, abs=1e-9)


def test_of_a_change_that_is_far_too_large_a_shorter_step_counts() -> None:
    column = Column(0, 0.5, 0.0, 1.0, 0.1, 0.0, visible=0.01, central=False)
    asked = []
    while column.wanted is not None:
        asked.append(column.wanted)
        column.take(np.array([np.exp(10.0 * column.wanted) - np.exp(5.0)]))
    assert len(asked) == 2
    assert column.slope == pytest.approx(10.0 * np.exp(5.0), rel=0.02)


def test_a_central_difference_that_is_shortened_takes_both_sides_of_the_shorter_step() -> None:
    def at(x: float) -> np.ndarray:
        return np.array([x + 20.0 * x**2])  # Over a whole step the square is twice the slope's part.

    column = Column(0, 0.0, -1.0, 1.0, 0.1, 0.0, visible=0.01, central=True)
    while column.wanted is not None:
        column.take(at(column.wanted))
    assert column.slope == pytest.approx(1.0, abs=1e-9)


def test_a_failing_side_is_answered_by_the_other() -> None:
    target = np.array([0.4, 0.3])
    search = LeastSquares(np.array([0.5, 0.45]))
    asked = run(search, lambda x: None if x[0] > 0.5 else 3.0 * (x - target))
    assert search.cost < 1e-10
    assert any(point[0] > 0.5 for point in asked)


def test_a_failing_start_is_the_end() -> None:
    search = LeastSquares(np.array([0.5]))
    search.tell([None for _ in search.ask()])
    assert search.done
    assert search.ending == "failed"
    assert search.ask() == []
    assert search.cost == np.inf


def test_only_the_free_coordinates_move() -> None:
    matrix, target = linear(3, 4)
    search = LeastSquares(np.full(4, 0.5), free=np.array([True, False, True, False]))
    asked = run(search, lambda x: matrix @ (x - target))
    assert all(point[1] == 0.5 and point[3] == 0.5 for point in asked)
    assert search.point[0] != 0.5


def test_a_known_jacobian_saves_the_differences() -> None:
    matrix, target = linear(4, 5)
    start = np.full(5, 0.5)
    search = LeastSquares(start, matrix @ (start - target), Settings(radius=2.0), jacobian=matrix)
    assert len(search.ask()) == 1
    search.tell([matrix @ (point - target) for point in search.ask()])
    assert search.cost == pytest.approx(
        2.0 * lsq_linear(matrix, matrix @ target, bounds=(0, 1), tol=1e-14).cost, rel=1e-6
    )


def test_the_last_simulations_are_not_spent_on_a_jacobian_that_nothing_can_follow() -> None:
    def function(x: np.ndarray) -> np.ndarray:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0], x[0] * x[1] - 0.9])

    search = LeastSquares(np.array([0.1, 0.9]), settings=Settings(radius=0.01))
    while search.simulations < 60 and not search.done:
        batch = search.ask(limit=2)
        if not batch:
            break
        if search.simulations > 3:
            assert len(batch) == 1
        search.tell([function(point) for point in batch])


def test_questions_repeat_until_they_are_answered_in_full() -> None:
    search = LeastSquares(np.array([0.5, 0.5]), residual=np.array([1.0, 2.0]))
    first = search.ask()
    assert np.array_equal(first, search.ask())
    with pytest.raises(BsaError, match="2 points were asked for"):
        search.tell([None])


def test_a_fit_counts_every_simulation_and_keeps_to_its_budget() -> None:
    space = ParameterSpace((Parameter("a", 1.0, 0.1, 10.0, "log"), Parameter("b", 0.2, -1.0, 1.0)))
    seen: list[Candidate] = []

    def function(points: list[np.ndarray]) -> list[np.ndarray]:
        asked = [space.from_unit(point) for point in points]
        seen.extend(asked)
        return [np.array([np.log(c["a"] / 3.0), c["b"] + 0.5, c["b"] * c["a"] + 1.5]) for c in asked]

    fit = LeastSquares(space.to_unit(space.initial))
    solve(fit, function, budget=40)
    assert space.from_unit(fit.point) == pytest.approx({"a": 3.0, "b": -0.5}, rel=1e-4)
    assert fit.simulations == len(seen) <= 40
    assert fit.ending not in ("", "failed", "blocked")
    assert fit.jacobian is not None
    for budget in range(1, 12):
        seen.clear()
        short = LeastSquares(space.to_unit(space.initial))
        solve(short, function, budget=budget)
        assert len(seen) == short.simulations <= budget
        assert short.residual is not None


@given(seeds)
@settings(max_examples=20)
def test_a_prior_pulls_as_an_observation_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, target = rng.normal(size=(6, 3)), rng.normal(size=6)
    prior = np.array([0.0, 1.0, 5.0])
    search = LeastSquares(
        np.full(3, 0.5),
        settings=Settings(radius=10.0, tolerance=1e-12),
        box=Box(np.full(3, -50.0), np.full(3, 50.0), prior),
    )
    run(search, lambda x: matrix @ x - target)
    wanted = np.linalg.lstsq(np.vstack([matrix, np.diag(prior)]), np.append(target, np.zeros(3)), rcond=None)[0]
    assert search.point == pytest.approx(wanted, abs=1e-4)
    assert search.cost == pytest.approx(np.sum((matrix @ wanted - target) ** 2) + np.sum((prior * wanted) ** 2))


def valley(x: np.ndarray) -> np.ndarray:
    """A narrow valley that bends by a right angle, with noise that no parameter explains."""
    noise = 0.3 * np.random.default_rng(0).normal(size=40)
    return np.concatenate([[60.0 * (x[0] * x[1] - 0.1), 3.0 * (x[0] - 0.8)], np.zeros(38)]) + noise


@pytest.mark.parametrize("start", [(0.12, 0.8), (0.5, 0.2), (0.95, 0.9)])
def test_a_fit_that_knows_the_noise_goes_on_down_a_flat_valley_until_nothing_is_predicted_beyond_it(start) -> None:
    fine = LeastSquares(np.array(start), settings=Settings(tolerance=1e-9))
    run(fine, valley)
    search = LeastSquares(np.array(start), settings=Settings(noise=0.3, tolerance=1 / 38))
    run(search, valley)
    assert search.ending == "noise"
    assert search.cost - fine.cost < 0.3**2


def test_a_fit_far_above_the_noise_says_that_the_misfit_ends_it() -> None:
    def misfit(x: np.ndarray) -> np.ndarray:
        return np.concatenate([10.0 * (x - 0.4), np.full(20, 3.0)])

    search = LeastSquares(np.array([0.45, 0.37]), settings=Settings(noise=0.01, tolerance=0.05))
    run(search, misfit)
    assert search.ending == "misfit"


def cliff(x: np.ndarray) -> np.ndarray:
    """Downhill to an edge over which the residuals jump, as where a cell is empty before its record ends."""
    jump = 20.0 if x[0] > 0.6 else 0.0
    return np.array([3.0 * (x[0] - 0.8), 2.0 * (x[1] - 0.3) + 0.5 * (x[0] - 0.5), 0.2 * (x[2] - 0.9), 0.5, jump])


@pytest.mark.parametrize("start", [(0.5, 0.5, 0.5), (0.1, 0.9, 0.2), (0.3, 0.3, 0.3)])
def test_at_the_edge_of_a_cliff_a_fit_ends_soon_and_near_its_best(start) -> None:
    search = LeastSquares(np.array(start), settings=Settings(tolerance=2e-3, ends_on_fresh=True, radius=np.inf))
    solve(search, lambda points: [cliff(point) for point in points], budget=120)
    best = np.sum(cliff(np.array([0.6, 0.275, 0.9])) ** 2)
    assert search.done
    assert search.simulations < 40
    assert search.cost < 1.25 * best


def test_a_fit_that_goes_on_from_fresh_derivatives_does_not_measure_them_again() -> None:
    def edge(x: np.ndarray) -> np.ndarray:
        return np.append(3.0 * (x - 0.7), 9.0 * np.any(x > 0.6))

    start = np.full(4, 0.6)
    jacobian = np.vstack([3.0 * np.eye(4), np.zeros(4)])
    search = LeastSquares(start, settings=Settings(tolerance=0.05), jacobian=jacobian, fresh=True)
    while batch := search.ask():
        assert len(batch) == 1
        search.tell([edge(point) for point in batch])
    assert search.ending == "no progress"
    assert search.simulations < 8


@given(seeds, st.floats(0.01, 2.0))
@settings(max_examples=60)
def test_a_step_keeps_its_bounds_and_its_length(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    jacobian = rng.normal(size=(10, count)) * 10.0 ** rng.uniform(-6, 6, count)
    residual = rng.normal(size=10)
    lower, upper = -rng.random(count), rng.random(count)
    lower[0] = 0.0
    step = bounded_step(jacobian, residual, lower, upper, radius)
    assert np.all(step >= lower - 1e-15)
    assert np.all(step <= upper + 1e-15)
    assert np.linalg.norm(step) <= radius * (1 + 1e-9)
    assert np.linalg.norm(residual + jacobian @ step) <= np.linalg.norm(residual) * (1 + 1e-12)


@pytest.mark.parametrize("seed", [122, 271])
def test_a_fit_that_wants_every_gain_ends_where_steps_vanish(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    matrix, offset, centre = rng.normal(size=(count + 5, count)), rng.normal(size=count + 5), rng.uniform(0, 1, count)
    bend = rng.choice([1.0, 5.0])

    def residuals(points: list[np.ndarray]) -> list[np.ndarray | None]:
        lucky = [np.random.default_rng(int(point.sum() * 1e9)).random() >= 0.2 for point in points]
        values = [matrix @ ((point - centre) + bend * (point - centre) ** 2) + offset for point in points]
        return [value if good else None for value, good in zip(values, lucky, strict=True)]

    search = LeastSquares(rng.random(count), settings=Settings(tolerance=0.0))
    solve(search, residuals, 1500)
    assert search.done


@pytest.mark.parametrize("emulates", [False, True])
def test_a_fit_without_a_neighbour_that_simulates_says_so(emulates: bool) -> None:
    start = np.array([0.5, 0.5])
    search = LeastSquares(start, settings=Settings(emulates=emulates))
    run(search, lambda x: np.array([1.0, 2.0]) if np.array_equal(x, start) else None)
    assert search.ending == "blocked"
    assert search.failed == (0, 1)
    assert search.predicted == np.inf


def test_a_coordinate_that_cannot_be_varied_is_named_and_the_others_are_fitted() -> None:
    search = LeastSquares(np.array([0.5, 0.5]), settings=Settings(tolerance=1e-9))
    run(search, lambda x: np.array([x[1] - 0.3, 1.0]) if x[0] == 0.5 else None)
    assert search.failed == (0,)
    assert search.ending not in ("", "blocked")
    assert search.point == pytest.approx([0.5, 0.3], abs=1e-5)


@pytest.mark.parametrize("emulates", [False, True])
def test_a_fit_with_nothing_free_is_done(emulates: bool) -> None:
    search = LeastSquares(np.array([0.5, 0.5]), settings=Settings(emulates=emulates), free=np.zeros(2, dtype=bool))
    assert len(run(search, lambda x: np.array([x[0], 2.0]))) == 1
    assert search.done
    assert search.ending == "noise"
    assert search.predicted == 0.0


def test_a_fit_with_nothing_free_is_done_though_its_derivatives_are_known() -> None:
    start, residual = np.array([0.5, 0.5]), np.array([0.5, 2.0])
    none = np.zeros(2, dtype=bool)
    search = LeastSquares(start, residual, Settings(emulates=True), none, jacobian=np.zeros((2, 2)), fresh=True)
    assert search.ask() == []
    assert search.ending == "noise"
