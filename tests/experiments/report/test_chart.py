import numpy as np
import pytest
from bsa.experiments.report.chart import Chart, horizontal, limits_around, padded, residual_limit


def test_rounding_does_not_scale_an_axis() -> None:
    """A constant current has an axis on which it is a line with ticks above and below it."""
    noisy = 2.28 + 4.4e-16 * np.arange(5.0)
    low, high = limits_around([noisy, np.full(5, 2.28)])
    assert low < 2.2 < 2.3 < high
    assert padded(2.28, 2.28 + 4.4e-16) == pytest.approx(padded(2.28, 2.28))


def test_an_axis_shows_a_small_swing_that_is_no_rounding() -> None:
    low, high = limits_around([np.array([3.7, 3.7005])])
    assert 3.69 < low < 3.7
    assert 3.7005 < high < 3.71


def test_a_short_spike_does_not_decide_an_axis_of_residuals() -> None:
    calm = np.tile([2.0, -2.0], 50)
    spike = np.append(calm, 1000.0)
    assert residual_limit([calm], 1.0) == residual_limit([calm, spike], 1.0) == pytest.approx(2.8)
    assert residual_limit([calm], 5.0) == residual_limit([np.array([])], 5.0) == 5.0


def test_every_peak_of_a_varying_current_is_drawn() -> None:
    chart = Chart("x", "x", horizontal(0.0, 8000.0), "Time / s")
    panel = chart.panel("Current / A", (0.0, 10.0), 96.0)
    current = np.zeros(8001)
    current[::20] = 1.0 + np.arange(401) % 9  # 400 peaks of different heights
    panel.draw(np.arange(8001.0), current, "best")
    drawn = np.array([point.split(",") for point in panel.lines[0].points.split()], dtype=float)
    peaks = np.unique(np.round(panel.axis.pixels(current[::20]), 1))
    assert np.sum(np.isin(drawn[:, 1], peaks)) >= 400
