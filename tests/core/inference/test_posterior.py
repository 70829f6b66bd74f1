import numpy as np
import pytest
from bsa.core.inference.posterior import beginning, going_on, sample
from bsa.core.prior import Prior
from scipy.stats import truncnorm


def quantiles(draws: np.ndarray) -> np.ndarray:
    return np.quantile(draws, [0.025, 0.5, 0.975], axis=0)


def drawn(centre: np.ndarray, residual: np.ndarray, jacobian: np.ndarray, bend: float = 0.0) -> np.ndarray:
    """Draws in the unit box, where every value is as likely before."""
    prior = Prior(np.full(len(centre), 0.5), np.zeros(len(centre)))

    def costs(normal: np.ndarray) -> np.ndarray:
        moved = prior.unit(normal) - centre
        misses = residual + moved @ jacobian.T + bend * moved[:, :1] ** 2
        return np.sum(misses**2, axis=1) + np.sum(normal**2, axis=1)

    here = prior.normal(centre)
    return prior.unit(sample(costs, beginning(here, residual, jacobian * prior.slopes(here))))


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 20])
def test_well_determined_parameters_have_the_linear_interval_around_the_linear_estimate(count: int) -> None:
    rng = np.random.default_rng(2)
    jacobian = rng.normal(size=(60, count)) * rng.choice([40.0, 80.0, 100.0], size=count)
    residual = rng.normal(size=60)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    mean, deviation = 0.5 - covariance @ jacobian.T @ residual, np.sqrt(np.diag(covariance))
    found = quantiles(drawn(np.full(count, 0.5), residual, jacobian))
    assert np.all(np.abs(found[1] - mean) < 0.2 * deviation)
    assert 0.5 * (found[2] - found[0]) == pytest.approx(1.96 * deviation, rel=0.15)


def test_a_parameter_that_nothing_fixes_keeps_its_whole_range_wherever_the_fit_ended() -> None:
    found = drawn(np.array([0.02, 0.5]), np.zeros(10), np.column_stack([np.zeros(10), np.full(10, 30.0)]))
    low, _, high = quantiles(found)
    assert (low[0], high[0]) == (pytest.approx(0.025, abs=0.03), pytest.approx(0.975, abs=0.03))


def test_a_bound_cuts_the_distribution_rather_than_the_interval() -> None:
    # The linear estimate lies at 0.1 with a deviation of 0.2.
    wanted = truncnorm.ppf([0.025, 0.975], -0.5, 4.5, 0.1, 0.2)
    low, _, high = quantiles(drawn(np.array([0.1]), np.zeros(1), np.array([[5.0]])))
    assert (low[0], high[0]) == (pytest.approx(wanted[0], abs=0.01), pytest.approx(wanted[1], abs=0.03))


def test_a_bend_makes_an_interval_lopsided() -> None:
    # The residual is 10 d + 40 d^2: upwards it grows faster than downwards.
    low, _, high = quantiles(drawn(np.array([0.5]), np.zeros(1), np.array([[10.0]]), 40.0))
    grid = np.linspace(0, 1, 20001)
    density = np.exp(-0.5 * (10.0 * (grid - 0.5) + 40.0 * (grid - 0.5) ** 2) ** 2)
    total = np.cumsum(density) / np.sum(density)
    wanted = grid[np.searchsorted(total, [0.025, 0.975])]
    assert (low[0], high[0]) == (pytest.approx(wanted[0], abs=0.02), pytest.approx(wanted[1], abs=0.02))


def test_a_sample_goes_on_where_the_cost_is_least() -> None:
    draws = np.random.default_rng(0).uniform(size=(400, 2))
    walkers = going_on(draws, lambda points: points[:, 0])
    assert walkers.shape == beginning(np.zeros(2), np.zeros(1), np.ones((1, 2))).shape
    assert np.max(walkers[:, 0]) < 0.5
