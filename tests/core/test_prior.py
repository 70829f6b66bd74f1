"""Priors of a search space as distances in the unit box."""

import math

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.prior import Prior

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


def test_about_a_point_the_bounds_say_where_the_others_lie() -> None:
    prior = Prior.of(SPACE).about(np.array([0.1, 0.2, 0.3]))
    assert prior.deviations(np.array([0.5, 0.2, 0.75])) == pytest.approx(np.zeros(3))
    assert prior.deviations(np.array([0.5, 1.2, 0.75]))[1] == pytest.approx(math.sqrt(12.0))
