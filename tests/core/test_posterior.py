import numpy as np
import pytest
from bsa.core.local_model import LocalModel
from bsa.core.posterior import sample
from scipy.stats import truncnorm


def quantiles(draws: np.ndarray) -> np.ndarray:
    return np.quantile(draws, [0.025, 0.5, 0.975], axis=0)


def test_well_determined_parameters_have_the_linear_interval_around_the_linear_estimate() -> None:
    rng = np.random.default_rng(2)
    jacobian = rng.normal(size=(60, 4)) * [40.0, 80.0, 60.0, 100.0]
    residual = rng.normal(size=60)
    model = LocalModel.straight(np.full(4, 0.5), residual, jacobian)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    mean, deviation = 0.5 - covariance @ jacobian.T @ residual, np.sqrt(np.diag(covariance))
    found = quantiles(sample(model))
    assert np.all(np.abs(found[1] - mean) < 0.15 * deviation)
    assert 0.5 * (found[2] - found[0]) == pytest.approx(1.96 * deviation, rel=0.12)


def test_a_parameter_that_nothing_fixes_keeps_its_whole_range_wherever_the_fit_ended() -> None:
    model = LocalModel.straight(np.array([0.02, 0.5]), np.zeros(10), np.column_stack([np.zeros(10), np.full(10, 30.0)]))
    low, _, high = quantiles(sample(model))
    assert (low[0], high[0]) == (pytest.approx(0.025, abs=0.03), pytest.approx(0.975, abs=0.03))


def test_a_bound_cuts_the_distribution_rather_than_the_interval() -> None:
    # The linear estimate lies at 0.1 with a deviation of 0.2.
    model = LocalModel.straight(np.array([0.1]), np.zeros(1), np.array([[5.0]]))
    wanted = truncnorm.ppf([0.025, 0.975], -0.5, 4.5, 0.1, 0.2)
    low, _, high = quantiles(sample(model))
    assert (low[0], high[0]) == (pytest.approx(wanted[0], abs=0.01), pytest.approx(wanted[1], abs=0.03))


def test_a_bend_makes_an_interval_lopsided() -> None:
    # The residual is 10 d + 40 d^2: upwards it grows faster than downwards.
    bent = LocalModel(np.array([0.5]), np.zeros(1), np.array([[10.0]]), np.array([[1.0]]), np.array([[80.0]]))
    assert bent.residual_at(np.array([0.6])) == pytest.approx([1.4])
    low, _, high = quantiles(sample(bent))
    grid = np.linspace(0, 1, 20001)
    density = np.exp(-0.5 * bent.cost_function()(grid[:, None]))
    total = np.cumsum(density) / np.sum(density)
    wanted = grid[np.searchsorted(total, [0.025, 0.975])]
    assert (low[0], high[0]) == (pytest.approx(wanted[0], abs=0.02), pytest.approx(wanted[1], abs=0.02))


def test_dispersion_widens_by_its_root() -> None:
    model = LocalModel.straight(np.array([0.5]), np.zeros(1), np.array([[100.0]]))
    wide, narrow = (np.std(sample(model, dispersion)) for dispersion in (4.0, 1.0))
    assert wide / narrow == pytest.approx(2.0, rel=0.1)
