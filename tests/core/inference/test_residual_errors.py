"""Errors of residuals: an error of one sign costs little, whatever its size."""

import numpy as np
import pytest
from bsa.core.inference.residual_errors import Errors


def test_an_error_of_one_sign_costs_little_and_others_as_much_as_before() -> None:
    doubt = np.array([3.0, 4.0, 0.0])
    errors = Errors(np.ones(3), np.array([0.5, 0.0, 0.0]), doubt)
    alone = errors.whitened(doubt - errors.shift)
    assert alone @ alone == pytest.approx(25.0 / 26.0)
    across = np.array([4.0, -3.0, 1.0])
    assert errors.whitened(across - errors.shift) == pytest.approx(across)
    plain = Errors(np.full(3, 2.0), np.zeros(3), np.zeros(3))
    assert plain.whitened(doubt) == pytest.approx(doubt / 2.0)
