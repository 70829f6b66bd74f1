import numpy as np
import pytest
from bsa.core.inference.emulator import _leading_rows, learn
from scipy.optimize import approx_fprime


def bent(points: np.ndarray) -> np.ndarray:
    """Thirty residuals of two parameters, of which the record sees the product."""
    product = (1.0 + points[:, 0]) * (1.0 + points[:, 1])
    along = np.linspace(0.0, 1.0, 30)
    return 40.0 * np.outer(product - 2.25, np.cos(along)) + 5.0 * np.outer(points[:, 0] ** 2, along)


def test_what_was_simulated_is_known_and_what_lies_between_is_close() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(size=(40, 2))
    found = learn(points, bent(points))
    costs = found.cost_function()
    assert costs(points) + found.beyond == pytest.approx(np.sum(bent(points) ** 2, axis=1), rel=0.02, abs=1.0)
    between = rng.uniform(0.1, 0.9, size=(20, 2))
    assert costs(between) + found.beyond == pytest.approx(np.sum(bent(between) ** 2, axis=1), rel=0.05, abs=2.0)


def test_far_from_every_simulation_the_emulator_rules_out_little() -> None:
    rng = np.random.default_rng(2)
    near = 0.2 + 0.05 * rng.uniform(size=(8, 2))
    found = learn(near, bent(near))
    here, away = (np.sum(found.predict(np.array([point]))[1]) for point in ([0.22, 0.22], [0.9, 0.1]))
    assert away > 100.0 * here
    far = np.array([[0.9, 0.1]])
    mean, variance = found.predict(far)
    # The likelihood of a guess this uncertain is wider than that of the guess taken for true.
    assert found.cost_function()(far)[0] < np.sum(mean**2)
    assert np.all(variance > 0.0)


def test_a_dispersion_divides_the_cost() -> None:
    points = np.random.default_rng(3).uniform(size=(40, 2))
    found = learn(points, bent(points))
    usual, wide = (found.cost_function(dispersion)(points) for dispersion in (1.0, 4.0))
    far = usual > 50.0
    assert wide[far] == pytest.approx(usual[far] / 4.0, rel=0.05)


def test_points_that_are_the_same_twice_are_no_trouble() -> None:
    points = np.repeat(np.random.default_rng(4).uniform(size=(6, 2)), 2, axis=0)
    assert np.all(np.isfinite(learn(points, bent(points)).cost_function()(points)))


def test_the_expected_cost_is_that_of_mean_and_variance_and_its_slopes_are_right() -> None:
    rng = np.random.default_rng(6)
    points = rng.uniform(size=(15, 2))
    found = learn(points, bent(points))
    for point in rng.uniform(size=(5, 2)):
        mean, variance = found.predict(point[None, :])
        value, slopes = found.expected_cost(point)
        assert value == pytest.approx(found.beyond + np.sum(mean**2 + variance))
        assert slopes == pytest.approx(approx_fprime(point, lambda at: found.expected_cost(at)[0], 1e-5), rel=1e-2)
        moved = [found.residuals((point + 1e-6 * step)[None, :])[0] for step in np.eye(2)]
        differences = (np.array(moved) - found.residuals(point[None, :])[0]).T / 1e-6
        assert found.derivatives(point) == pytest.approx(differences, rel=1e-3, abs=1e-3)


def test_leading_rows_are_those_of_a_singular_value_decomposition() -> None:
    rng = np.random.default_rng(7)
    changes = (rng.normal(size=(30, 6)) * np.geomspace(100.0, 1e-4, 6)) @ rng.normal(size=(6, 400))
    rows = _leading_rows(changes)
    _, singular, all_rows = np.linalg.svd(changes, full_matrices=False)
    left_out = np.sqrt(np.sum(singular[len(rows) :] ** 2) / 30)
    assert left_out <= 0.03 < np.sqrt(np.sum(singular[len(rows) - 1 :] ** 2) / 30)
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(rows * all_rows[: len(rows)], axis=1)), 1.0, atol=1e-6)
