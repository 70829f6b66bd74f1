"""The band of a life's capacity: parameters and scatter together."""

import numpy as np
import pytest
from bsa.core.ageing.fade_band import FadeBand


def test_parameters_and_scatter_add_in_quadrature() -> None:
    slopes = np.array([[0.0, 0.0], [2.0, 1.0]])
    covariance = [[1e-4, 0.0], [0.0, 4e-4]]
    band = FadeBand.propagated(np.array([1.0, 101.0]), slopes, covariance, 0.01)
    assert band.half_ah[0] == pytest.approx(1.96 * 0.01)
    assert band.half_ah[1] == pytest.approx(1.96 * np.sqrt(4e-4 + 4e-4 + 1e-4))
    assert band.at(np.array([51.0]))[0] == pytest.approx(np.mean(band.half_ah))
