"""Impedance spectra as Nyquist plots."""

import numpy as np
import pytest
from bsa.core.comparison.spectrum_record import spectrum_record
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.trajectory import Trajectory
from bsa.experiments.report.nyquist import nyquist
from bsa.experiments.report.templates import template


def spectrum(first_hz: float, last_hz: float, points: int) -> Trajectory:
    """Two arcs and the tail of a diffusion."""
    frequency = np.geomspace(first_hz, last_hz, points)
    w = 2j * np.pi * frequency
    z = 0.02 + 0.008 / (1 + 0.002 * w) + 0.012 / (1 + 0.15 * w) + 0.004 / np.sqrt(w)
    return spectrum_record(ImpedanceSpectrum("z", frequency, z))


@pytest.mark.parametrize("ends", [(1e4, 1e-2), (1e-2, 1e4)])
def test_decades_of_the_measured_frequencies_stand_beside_their_points(ends: tuple[float, float]) -> None:
    measured = spectrum(*ends, 61)
    (panel,) = nyquist("z", "", {"measured": measured, "best": measured}, []).panels
    points = {marker.title: marker for marker in panel.markers if marker.style == "measured"}
    assert {"100 Hz", "1 Hz", "0.01 Hz"} <= {label.text for label in panel.labels}
    for label in panel.labels:
        point = points[label.text]
        assert np.hypot(label.x - point.x, label.y - point.y) < 20.0
        assert panel.across.start < label.x < panel.across.end
        assert panel.top < label.y < panel.axis.start
    assert all(
        np.hypot(one.x - other.x, one.y - other.y) > 20.0
        for place, one in enumerate(panel.labels)
        for other in panel.labels[:place]
    )


def test_a_spectrum_between_two_decades_has_no_label() -> None:
    (panel,) = nyquist("z", "", {"measured": spectrum(8.0, 1.5, 12)}, []).panels
    assert panel.labels == []


def test_labels_are_drawn() -> None:
    draw = template("report.html.j2").environment.get_template("chart.svg.j2").module.draw  # type: ignore[attr-defined]
    assert ">1 Hz</text>" in draw(nyquist("z", "", {"measured": spectrum(1e4, 1e-2, 61)}, []))
