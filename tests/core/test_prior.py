"""Priors of a search space as distances in the unit box."""

import math

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.prior import Prior
from scipy.stats import kstest, truncnorm

SPACE = ParameterSpace(
    (
        Parameter("known", 2.0, 1.0, 4.0, scale="log", deviation=0.1, prior=True),
        Parameter("scaled", 0.0, -1.0, 1.0, deviation=0.5),
        Parameter("offset", 0.0, -0.3, 0.1, deviation=0.05, prior=True),
    )
)


def test_deviations_are_those_of_the_parameters_own_scale() -> None:
    prior = Prior.of(SPACE)
    point = SPACE.to_unit({"known": 2.0 * math.exp(0.2), "scaled": 1.0, "offset": -0.05})
    assert prior.deviations(point) == pytest.approx([2.0, 0.0, -1.0])
    assert prior.residuals(np.array([7.0]), point, 3.0) == pytest.approx([7.0, 6.0, 0.0, -3.0])


def test_derivatives_are_those_of_the_residuals() -> None:
    prior, here = Prior.of(SPACE), np.array([0.4, 0.5, 0.6])
    slopes = np.array([[1.0, 2.0, 3.0]])
    moved = [(prior.residuals(slopes @ (here + step), here + step, 2.0)) for step in 0.1 * np.eye(3)]
    there = prior.residuals(slopes @ here, here, 2.0)
    assert pytest.approx(prior.jacobian(slopes, 2.0)) == (np.array(moved) - there).T / 0.1


def test_a_search_that_weighs_no_priors_has_none() -> None:
    assert not np.any(Prior.of(SPACE, weighed=False).deviations(np.ones(3)))


def test_in_normal_coordinates_the_prior_within_the_bounds_is_standard_normal() -> None:
    prior = Prior.of(SPACE)
    normal = np.random.default_rng(0).standard_normal((4000, 3))
    points = prior.unit(normal)
    assert prior.normal(points) == pytest.approx(normal, abs=1e-6)
    assert kstest(points[:, 1], "uniform").pvalue > 0.01
    # The offset may be 0.3 below its initial value and 0.1 above: six deviations and two.
    offset = (SPACE["offset"].lower + 0.4 * points[:, 2]) / 0.05
    assert kstest(offset, truncnorm(-6.0, 2.0).cdf).pvalue > 0.01


def test_normal_coordinates_have_the_derivatives_that_they_say() -> None:
    prior, normal = Prior.of(SPACE), np.array([[0.5, -1.0, 1.8], [-2.0, 2.0, -0.3]])
    ahead, behind = prior.unit(normal + 1e-5), prior.unit(normal - 1e-5)
    assert prior.slopes(normal) == pytest.approx((ahead - behind) / 2e-5, rel=1e-5)


def test_a_point_on_a_bound_has_normal_coordinates() -> None:
    prior = Prior.of(SPACE)
    assert np.all(np.isfinite(prior.normal(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]))))


def test_priors_are_measured_as_wide_as_an_even_range() -> None:
    points = Prior.of(SPACE).unit(np.random.default_rng(0).standard_normal((4000, 3)))
    spread = np.std(Prior.of(SPACE).as_wide_as_the_box(points), axis=0)
    assert spread[:2] == pytest.approx(12.0**-0.5, rel=0.05)
