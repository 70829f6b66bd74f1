"""The picture of an impedance spectrum."""

import numpy as np
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.experiments.data.picture import _nyquist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def test_frequencies_stand_inside_the_frame_and_are_written_out() -> None:
    frequency = np.logspace(4, -3, 50) * 1.1
    # Two arcs and a tail of diffusion that ends in the upper right corner.
    impedance = 0.02 + 0.01 / (1 + 0.03j * frequency) + 0.01 * (1j * frequency) ** -0.25
    figure = Figure(figsize=(8, 6), layout="constrained")
    _nyquist(figure, ImpedanceSpectrum("z.csv", frequency, impedance))
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    labels = [text.get_text() for text in axes.texts]
    assert "1,100 Hz" in labels
    assert not any("e+" in label for label in labels)
    frame = axes.get_window_extent()
    for text in axes.texts:
        box = text.get_window_extent()
        assert frame.x0 <= box.x0, text.get_text()
        assert box.x1 <= frame.x1, text.get_text()
