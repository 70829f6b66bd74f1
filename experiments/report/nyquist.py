"""Impedance spectra as Nyquist plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...core.cell import FREQUENCY, REACTANCE, RESISTANCE
from ...core.trajectory import FloatArray, Trajectory
from .chart import BOTTOM, LEFT, RIGHT, TOP, WIDTH, Chart, Key, Marker, Panel, horizontal, padded, vertical
from .wording import number

_HEIGHTS = (160.0, 440.0)
"""Least and largest height of the panel, px; between them an ohm is as long on both axes."""


def nyquist(name: str, description: str, curves: Mapping[str, Trajectory], keys: Sequence[Key]) -> Chart:
    """The negative imaginary part over the real part; the axes show the measured spectrum well.

    Parameters
    ----------
    name, description : str
        The figure's, for programs and for those who cannot see it.
    curves : mapping of str to Trajectory
        Spectra by their style, the measured one first.
    keys : sequence of Key
        The legend.
    """
    drawn = {style: _milliohm(curve) for style, curve in curves.items()}
    real, turned = (_limits([curve[part] for curve in drawn.values()]) for part in (0, 1))
    across = horizontal(*padded(*real))
    low, high = padded(*turned)
    scale = (WIDTH - LEFT - RIGHT) / (across.high - across.low)
    axis = vertical(low, high, TOP, float(np.clip(scale * (high - low), *_HEIGHTS)))
    panel = Panel(axis, "-Im Z / mΩ", ticks=axis.ticks(5))
    for style, (x, y) in drawn.items():
        panel.draw(across, x, y, style)
        panel.markers += [
            Marker(float(across.pixels(a)), float(axis.pixels(b)), style, f"{number(hertz)} Hz")
            for a, b, hertz in zip(x, y, curves[style].values(FREQUENCY.name), strict=True)
        ]
    return Chart(
        name=name,
        title="Impedance",
        description=description,
        panels=[panel],
        x_ticks=across.ticks(8),
        x_label="Re Z / mΩ",
        keys=list(keys),
        height=axis.start + BOTTOM,
    )


def _milliohm(spectrum: Trajectory) -> tuple[FloatArray, FloatArray]:
    real, turned = (part.shown_scale * spectrum.values(part.name) for part in (RESISTANCE, REACTANCE))
    return real, turned


def _limits(curves: Sequence[FloatArray]) -> tuple[float, float]:
    """Ends that hold the measured curve, and of wild simulations what lies half its size beyond."""
    low, high = float(curves[0].min()), float(curves[0].max())
    margin = 0.5 * (high - low)
    return (
        max(min(float(curve.min()) for curve in curves), low - margin),
        min(max(float(curve.max()) for curve in curves), high + margin),
    )
