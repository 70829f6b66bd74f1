"""Draws that are fits of their own: right where responses bend, and where the data say nothing."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from bsa.core.prior import Prior
from bsa.core.randomised_draws import randomised_draws

COUNT = 400
NO_PRIOR = Prior(np.full(2, 0.5), np.zeros(2))

Residuals = Callable[[np.ndarray], np.ndarray]


def draws_of(residuals: Residuals, slopes: np.ndarray, prior: Prior = NO_PRIOR, excess: float = 1.0) -> np.ndarray:
    def simulate(points: np.ndarray) -> Sequence[np.ndarray | None]:
        return [excess * residuals(point) for point in points]

    centre = np.full(2, 0.5)
    return randomised_draws(centre, residuals(centre), slopes, excess, prior, simulate, COUNT)


@pytest.mark.parametrize("excess", [1.0, 7.0])
def test_straight_responses_give_the_linear_posterior(excess: float) -> None:
    slopes = np.random.default_rng(0).normal(size=(20, 2)) * 20.0
    draws = draws_of(lambda point: slopes @ (point - 0.5), slopes, excess=excess)
    assert len(draws) == COUNT
    expected = np.linalg.inv(slopes.T @ slopes + 12.0 * np.eye(2))
    assert np.cov(draws.T) == pytest.approx(expected, rel=0.2, abs=0.05 * np.sqrt(np.prod(np.diag(expected))))


def test_draws_stay_in_a_valley_that_bends() -> None:
    """The data see x + 3 (y - 1/2)^2 to a percent; of y alone its prior of 0.1 tells."""

    def residuals(point: np.ndarray) -> np.ndarray:
        return np.array([100.0 * (point[0] - 0.5 + 3.0 * (point[1] - 0.5) ** 2)])

    prior = Prior(np.full(2, 0.5), np.array([0.0, 1 / 0.1]))
    draws = draws_of(residuals, np.array([[100.0, 0.0]]), prior)
    assert len(draws) > 0.9 * COUNT
    cost = np.array([residuals(point)[0] ** 2 for point in draws])
    assert np.quantile(cost, 0.9) < 6.0
    assert np.std(draws[:, 1]) == pytest.approx(0.1, rel=0.25)
    linear = draws.copy()
    linear[:, 0] = 0.5
    assert np.quantile([residuals(point)[0] ** 2 for point in linear], 0.9) > 20.0


def test_a_draw_that_cannot_be_simulated_is_left_out() -> None:
    asked: list[int] = []

    def never(points: np.ndarray) -> Sequence[np.ndarray | None]:
        asked.append(len(points))
        return [None] * len(points)

    slopes = 10.0 * np.eye(3)[:, :2]
    draws = randomised_draws(np.full(2, 0.5), np.zeros(3), slopes, 1.0, NO_PRIOR, never, 4)
    # One was perturbed so little that the fit itself meets it.
    assert draws == pytest.approx(np.full((1, 2), 0.5))
    assert len(asked) == 5
    assert max(asked) == 4
