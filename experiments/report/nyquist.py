"""Impedance spectra as Nyquist plots."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...core.cell import FREQUENCY, REACTANCE, RESISTANCE
from ...core.trajectory import FloatArray, Trajectory
from .chart import LEFT, RIGHT, WIDTH, Chart, Key, horizontal, limits_around
from .wording import number

_HEIGHTS = (160.0, 440.0)
"""Least and largest height of the panel, px; between them an ohm is as long on both axes."""


def nyquist(name: str, description: str, curves: Mapping[str, Trajectory], keys: Sequence[Key]) -> Chart:
    """The negative imaginary part over the real part; the axes show the measured spectrum well.

    ``name`` and ``description`` are for programs and for those who cannot see the figure; ``curves`` are spectra by
    their style, the measured one first.
    """
    drawn = {style: _milliohm(curve) for style, curve in curves.items()}
    real, turned = (limits_around([curve[part] for curve in drawn.values()]) for part in (0, 1))
    chart = Chart(name, "Impedance", horizontal(*real), "Re Z / mohm", description, list(keys))
    scale = (WIDTH - LEFT - RIGHT) / (chart.across.high - chart.across.low)
    height = float(np.clip(scale * (turned[1] - turned[0]), *_HEIGHTS))
    panel = chart.panel("-Im Z / mohm", turned, height, ticks=5)
    for style, (x, y) in drawn.items():
        panel.draw(x, y, style)
        for a, b, hertz in zip(x, y, curves[style].values(FREQUENCY.name), strict=True):
            panel.point(a, b, style, f"{number(hertz)} Hz")
    return chart


def _milliohm(spectrum: Trajectory) -> tuple[FloatArray, FloatArray]:
    real, turned = (part.shown_scale * spectrum.values(part.name) for part in (RESISTANCE, REACTANCE))
    return real, turned
