"""Impedance spectra as Nyquist plots."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...core.cell import FREQUENCY, REACTANCE, RESISTANCE
from ...core.trajectory import FloatArray, Trajectory
from .chart import LEFT, RIGHT, WIDTH, Chart, Key, Label, Panel, horizontal, limits_around
from .wording import number

_HEIGHTS = (160.0, 440.0)
"""Least and largest height of the panel, px; between them an ohm is as long on both axes."""

_NEAR = 0.06
"""Share of a decade by which the frequency of a labelled point is off at most: ten points a decade have one as near."""

_BESIDE, _HALF_LETTER, _LETTER, _ROOM, _FLAT, _SLANTED = 13.0, 3.5, 6.0, 60.0, 2.5, 0.3
"""Of labels: their distance from the curve, half the height and the width of a letter, the distance between two, px;
how much more upright distances count; and how far a normal of the curve leans where a label begins or ends at it."""


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
    measured = next(iter(curves.values()))
    panel.labels += _decades(panel, list(drawn.values()), measured.values(FREQUENCY.name))
    for style, (x, y) in drawn.items():
        panel.draw(x, y, style)
        for a, b, hertz in zip(x, y, curves[style].values(FREQUENCY.name), strict=True):
            panel.point(a, b, style, f"{number(hertz)} Hz")
    return chart


def _decades(panel: Panel, curves: Sequence[tuple[FloatArray, FloatArray]], hertz: FloatArray) -> list[Label]:
    """The powers of ten among the frequencies of the first spectrum, beside its points, where there is room."""
    drawn = [np.column_stack([panel.across.pixels(x), panel.axis.pixels(y)]) for x, y in curves]
    order = np.argsort(-hertz)
    points, decades, everything = drawn[0][order], np.log10(hertz[order]), np.concatenate(drawn)
    found: list[Label] = []
    for decade in range(int(np.floor(decades.max())), int(np.ceil(decades.min())) - 1, -1):
        k = int(np.argmin(np.abs(decades - decade)))
        way = points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)]
        normal = np.array([-way[1], way[0]]) / (float(np.hypot(*way)) or 1.0)
        text = f"{number(10.0**decade)} Hz"
        sides = [_beside(points[k], side * normal, text) for side in (1.0, -1.0)]
        free = [side for side in sides if _is_free(panel, everything, side[1], text)]
        if not free or abs(decades[k] - decade) > _NEAR:
            continue
        label, middle = max(free, key=lambda side: float(_apart(everything, side[1]).min()))
        if all(_apart(middle, np.array([one.x, one.y])) >= _ROOM for one in found):
            found.append(label)
    return found


def _beside(point: FloatArray, way: FloatArray, text: str) -> tuple[Label, FloatArray]:
    """A label at a point, in a direction of length 1, and where its middle is, px."""
    place = point + _BESIDE * way
    end = 0 if abs(way[0]) < _SLANTED else int(np.sign(way[0]))
    label = Label(float(place[0]), float(place[1] + _HALF_LETTER), text, ("middle", "start", "end")[end])
    return label, place + np.array([0.5 * end * _LETTER * len(text), 0.0])


def _is_free(panel: Panel, points: FloatArray, middle: FloatArray, text: str) -> bool:
    """Whether a text lies inside the panel and on no point."""
    half = np.array([0.5 * _LETTER * len(text), 2 * _HALF_LETTER])
    inside = panel.across.start + half[0] <= middle[0] <= panel.across.end - half[0]
    inside &= panel.top + _HALF_LETTER <= middle[1] <= panel.axis.start - _HALF_LETTER
    return bool(inside and not np.any(np.all(np.abs(points - middle) < half, axis=1)))


def _apart(points: FloatArray, place: FloatArray) -> FloatArray:
    """Distances of points from a place, px; a text is wider than high, so that those upwards count more."""
    return np.asarray(np.hypot(points[..., 0] - place[0], _FLAT * (points[..., 1] - place[1])))


def _milliohm(spectrum: Trajectory) -> tuple[FloatArray, FloatArray]:
    real, turned = (part.shown_scale * spectrum.values(part.name) for part in (RESISTANCE, REACTANCE))
    return real, turned
