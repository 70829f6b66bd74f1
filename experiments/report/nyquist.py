"""Impedance spectra as Nyquist plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.spectrum import ImpedanceSpectrum
from ...core.trajectory import FloatArray
from ..predict import PredictedSpectrum
from .chart import BOTTOM, LEFT, RIGHT, TOP, WIDTH, Chart, Key, Marker, Panel, horizontal, padded, vertical
from .wording import number

_HEIGHTS = (160.0, 440.0)
"""Least and largest height of the panel, px; between them an ohm is as long on both axes."""


def nyquist(spectra: Sequence[PredictedSpectrum]) -> list[Chart]:
    """One figure for each spectrum: measured and simulated, up to the frequency at which the measured one is real."""
    return [_nyquist(place, one) for place, one in enumerate(spectra)]


def _nyquist(place: int, one: PredictedSpectrum) -> Chart:
    curves = {
        "measured": _milliohm(one.measured, one.errors.ohmic_hz),
        "best": _milliohm(one.simulated, one.errors.ohmic_hz),
    }
    real, turned = (np.concatenate(parts) for parts in zip(*curves.values(), strict=True))
    across = horizontal(*padded(float(real.min()), float(real.max())))
    low, high = padded(float(turned.min()), float(turned.max()))
    scale = (WIDTH - LEFT - RIGHT) / (across.high - across.low)
    axis = vertical(low, high, TOP, float(np.clip(scale * (high - low), *_HEIGHTS)))
    panel = Panel(axis, "-Im Z / mΩ", ticks=axis.ticks(5))
    kept = one.measured.frequency[one.measured.frequency <= one.errors.ohmic_hz]
    for style, (x, y) in curves.items():
        panel.draw(across, x, y, style)
        panel.markers += [
            Marker(float(across.pixels(a)), float(axis.pixels(b)), style, f"{number(hertz)} Hz")
            for a, b, hertz in zip(x, y, kept, strict=True)
        ]
    return Chart(
        name=f"impedance-{place}",
        title=f"Impedance of {one.errors.record}",
        description=one.errors.line,
        panels=[panel],
        x_ticks=across.ticks(8),
        x_label="Re Z / mΩ",
        keys=[Key("measured", "measured"), Key("best", "simulated")],
        height=axis.start + BOTTOM,
    )


def _milliohm(spectrum: ImpedanceSpectrum, highest_hz: float) -> tuple[FloatArray, FloatArray]:
    kept = spectrum.impedance[spectrum.frequency <= highest_hz]
    return 1e3 * kept.real, -1e3 * kept.imag
