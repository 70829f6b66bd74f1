from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.inference.simulated_posterior import _spread_within, simulated_posterior
from bsa.core.prior import Prior

Simulate = Callable[[np.ndarray], list[np.ndarray | None]]

NO_PRIOR = Prior(np.full(2, 0.5), np.zeros(2))


def residuals(points: np.ndarray) -> np.ndarray:
    """A record that sees the product of two parameters to half a percent, and nothing else of them."""
    product = (0.2 + points[:, 0]) * (0.2 + points[:, 1])
    return np.column_stack([200.0 * (product / 0.49 - 1.0), np.zeros(len(points))])


def recording(model: Callable[[np.ndarray], np.ndarray]) -> tuple[list[int], Simulate]:
    """How many points each round asked for, and the simulations of a model."""
    asked: list[int] = []

    def simulate(points: np.ndarray) -> list[np.ndarray | None]:
        asked.append(len(points))
        return list(model(points))

    return asked, simulate


@pytest.mark.slow
def test_draws_follow_a_curved_valley_to_its_ends() -> None:
    asked, simulate = recording(residuals)
    centre = np.array([0.5, 0.5])
    start = [centre, *(centre + step for step in ([0.007, 0.0], [0.0, 0.007], [0.2, 0.0], [0.0, -0.2]))]
    slope = 200.0 * 0.7 / 0.49
    found = simulated_posterior(
        start, list(residuals(np.array(start))), np.array([[slope, slope], [0.0, 0.0]]), simulate, NO_PRIOR
    )
    draws = found.draws
    assert found.excess == found.widened == 1.0
    assert len(found.followed) == 0
    assert sum(asked) <= 64
    # A straight interval would leave the valley at once: at its ends the product is 40 % off along the tangent.
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    assert np.all(low < 0.3)
    assert np.all(high > 0.9)
    assert np.quantile(np.sum(residuals(draws) ** 2, axis=1), 0.9) < 8.0


@pytest.mark.slow
def test_a_valley_that_is_straight_takes_one_round() -> None:
    slopes = np.random.default_rng(0).normal(size=(20, 2)) * 50.0

    def line(points: np.ndarray) -> np.ndarray:
        return (points - 0.5) @ slopes.T

    asked, simulate = recording(line)
    rng = np.random.default_rng(1)
    start = [np.full(2, 0.5), *rng.uniform(0.4, 0.6, size=(12, 2))]
    draws = simulated_posterior(start, list(line(np.array(start))), slopes, simulate, NO_PRIOR).draws
    deviation = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert len(asked) == 1
    assert np.std(draws, axis=0) == pytest.approx(deviation, rel=0.12)


@pytest.mark.slow
@pytest.mark.parametrize(("off", "held"), [(0.0, True), (0.01, True), (0.1, False)])
def test_a_fit_that_stopped_short_is_told_from_one_that_is_as_likely_as_the_draws(off: float, held: bool) -> None:
    """Two hundred residuals see each parameter to about a hundredth of its range."""
    rng = np.random.default_rng(4)
    slopes, noise = rng.normal(size=(200, 2)) * 7.0, rng.normal(size=200)

    def line(points: np.ndarray) -> np.ndarray:
        return (points - 0.5) @ slopes.T + noise

    asked, simulate = recording(line)
    start = np.array([0.5 + off, 0.5]) + np.vstack([np.zeros(2), 0.007 * np.eye(2)])
    found = simulated_posterior(start, list(line(start)), slopes, simulate, NO_PRIOR)
    assert asked
    assert found.holds_best == held


@pytest.mark.slow
def test_many_parameters_with_priors_of_their_own_are_drawn_about_as_wide_as_they_are() -> None:
    """Of eighteen parameters a record sees six; of the others the priors tell, whose widths differ."""
    rng = np.random.default_rng(3)
    slopes = np.zeros((40, 18))
    slopes[:, :6] = rng.normal(size=(40, 6)) * 100.0
    width = np.tile([0.02, 0.05, 0.1], 6)
    prior = Prior(np.full(18, 0.5), 1.0 / width)

    def respond(points: np.ndarray) -> list[np.ndarray | None]:
        return list((points - 0.5) @ slopes.T)

    start = [np.full(18, 0.5), *(np.full(18, 0.5) + 0.01 * np.eye(18))]
    draws = simulated_posterior(start, respond(np.array(start)), slopes, respond, prior).draws
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes + np.diag(width**-2.0))))
    assert np.std(draws, axis=0) == pytest.approx(expected, rel=0.25)


@pytest.mark.slow
def test_a_cell_that_runs_empty_early_does_not_spoil_what_is_learnt() -> None:
    """Beyond a cliff all residuals are thousands of deviations off."""
    slopes = np.random.default_rng(0).normal(size=(20, 2)) * 50.0

    def respond(points: np.ndarray) -> list[np.ndarray | None]:
        cliff = np.maximum(points[:, :1] - 0.6, 0.0) * 1e5
        return list((points - 0.5) @ slopes.T + cliff)

    rng = np.random.default_rng(1)
    start = [np.full(2, 0.5), *rng.uniform(0.4, 0.7, size=(12, 2))]
    draws = simulated_posterior(start, respond(np.array(start)), slopes, respond, NO_PRIOR).draws
    deviation = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert np.std(draws, axis=0) == pytest.approx(deviation, rel=0.25)


@pytest.mark.slow
def test_a_budget_bounds_the_simulations_and_what_it_leaves_unknown_widens_the_sample() -> None:
    """Draws of a curved valley that two simulations a round do not settle."""
    asked, simulate = recording(residuals)
    centre = np.array([0.5, 0.5])
    start = np.array([centre, *(centre + step for step in ([0.007, 0.0], [0.0, 0.007]))])
    slope = 200.0 * 0.7 / 0.49
    slopes = np.array([[slope, slope], [0.0, 0.0]])
    found = simulated_posterior(start, list(residuals(start)), slopes, simulate, NO_PRIOR, rounds=2, most=5)
    assert asked == [2, 2]
    assert found.excess == 1.0
    assert found.widened > 1.0
    low, high = np.quantile(found.draws, [0.025, 0.975], axis=0)
    assert np.all(low < 0.3)
    assert np.all(high > 0.9)


@pytest.mark.slow
@pytest.mark.parametrize("most", [None, 30])
def test_draws_that_never_come_out_as_predicted_widen_the_sample_whatever_the_budget(most: int | None) -> None:
    """Residuals that are rough in the parameters, which no emulator learns."""
    rng = np.random.default_rng(1)
    slopes, base = 6.0 * rng.normal(size=(60, 2)), rng.normal(size=60)

    def rough(points: np.ndarray) -> np.ndarray:
        return np.array([base + slopes @ (point - 0.5) + rng.normal(size=60) for point in points])

    asked, simulate = recording(rough)
    start = np.array([[0.5, 0.5], [0.51, 0.5], [0.5, 0.51], [0.6, 0.4]])
    found = simulated_posterior(start, [base, *rough(start[1:])], slopes, simulate, NO_PRIOR, most=most)
    assert found.widened > 3.0
    assert asked == ([4] * 6 if most else [16] * len(asked)), "a small budget is used up"
    assert len(asked) < 6 or most, "further rounds would come no nearer"
    assert found.cut_short == (most is not None)
    assert len(found.followed) == 0, "no neighbour of the fit follows the record as it does"


@pytest.mark.slow
def test_a_sample_none_of_whose_draws_ran_is_widened() -> None:
    slopes = 6.0 * np.random.default_rng(1).normal(size=(60, 2))
    start = np.array([[0.5, 0.5], [0.51, 0.5], [0.5, 0.51]])
    known = list((start - 0.5) @ slopes.T)
    asked: list[int] = []

    def fail(points: np.ndarray) -> list[np.ndarray | None]:
        asked.append(len(points))
        return [None] * len(points)

    found = simulated_posterior(start, known, slopes, fail, NO_PRIOR)
    assert found.widened == pytest.approx(np.sqrt(2.0))
    assert len(asked) == 2, "what fails twice over is not tried six times"


@pytest.mark.slow
def test_residuals_that_weigh_nothing_do_not_make_the_misfit_look_smaller() -> None:
    rng = np.random.default_rng(2)
    slopes, misfit = rng.normal(size=(200, 2)) * 50.0, 4.0 * rng.normal(size=200)

    def line(points: np.ndarray) -> np.ndarray:
        return (points - 0.5) @ slopes.T + misfit

    def with_idle(points: np.ndarray) -> np.ndarray:
        return np.hstack([line(points), np.zeros((len(points), 200))])

    start = [np.full(2, 0.5), *rng.uniform(0.4, 0.6, size=(12, 2))]
    idle_slopes = np.vstack([slopes, np.zeros_like(slopes)])
    excess = [
        simulated_posterior(start, list(model(np.array(start))), known, recording(model)[1], NO_PRIOR).excess
        for model, known in ((line, slopes), (with_idle, idle_slopes))
    ]
    assert excess[1] == pytest.approx(excess[0])


def test_simulated_points_are_spread_over_the_region_that_holds_the_posterior() -> None:
    rng = np.random.default_rng(7)
    slopes = 20.0 * np.eye(2)
    points = np.vstack([np.full((1, 2), 0.5), rng.uniform(0.0, 1.0, (2000, 2))])
    chosen = _spread_within(points, (points - 0.5) @ slopes.T, NO_PRIOR)
    assert len(chosen) == 20
    far = np.linalg.norm(20.0 * (chosen - 0.5), axis=1)
    assert np.all(far < np.sqrt(5.99))
    assert far[0] > 2.0
    near = [np.sort(np.linalg.norm(chosen - one, axis=1))[1] for one in chosen]
    assert min(near) > 0.01
    assert len(_spread_within(points[:1], np.zeros((1, 2)), NO_PRIOR)) == 0
