"""Constants of the normal distribution."""

import numpy as np
import pytest
from bsa.core.normal import NORMAL_95, robust_deviation
from scipy.stats import norm


def test_the_half_width_is_that_of_the_distribution():
    assert norm.ppf(0.975) == pytest.approx(NORMAL_95, abs=1e-4)


def test_a_third_of_outliers_hardly_moves_the_deviation():
    values = np.random.default_rng(1).normal(0.0, 2.0, 20_000)
    assert robust_deviation(values) == pytest.approx(2.0, rel=0.02)
    values[::3] = 1e6
    assert robust_deviation(values) < 4.0
