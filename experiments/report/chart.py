"""Charts as plain geometry: panels over one horizontal axis, in pixels, ready for the SVG template."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...core.thinning import ROUNDING
from ...core.trajectory import FloatArray
from .thinning import thin_curve
from .wording import number

WIDTH, LEFT, RIGHT, TOP, BOTTOM, GAP = 880.0, 64.0, 14.0, 8.0, 40.0, 16.0
MOST_POINTS = 2000
"""Points of a drawn curve at most: four for each place along x that `thin_curve` tells apart; smooth ones have few."""
_FAR = 5000.0


_MOST_OF_TIME, _ROOM = 97, 1.4
"""Percentile of residuals that an axis of residuals is for, and its length by that."""


def residual_limit(values: Sequence[FloatArray], least: float) -> float:
    """Where an axis of residuals ends on both sides, ``least`` or more.

    Where a step ends, or a cell is empty, a moment early the residual is a spike: the axis is for what lies between.
    """
    usual = [float(np.percentile(np.abs(one), _MOST_OF_TIME)) for one in values if len(one)]
    return max(_ROOM * max(usual, default=0.0), least)


@dataclass(frozen=True)
class Axis:
    """From values to pixels."""

    # low, high: Values at the ends.
    low: float
    high: float
    # start, end: Pixels at the ends.
    start: float
    end: float
    log: bool = False  # Whether the axis is logarithmic.

    def pixels(self, values: FloatArray | float) -> FloatArray:
        """Where values lie; far outside they stay just far outside."""
        values = np.asarray(values, dtype=np.float64)
        low, high = self.low, self.high
        if self.log:
            values, low, high = np.log10(np.maximum(values, 1e-300)), math.log10(low), math.log10(high)
        return np.clip(self.start + (values - low) / (high - low) * (self.end - self.start), -_FAR, _FAR)

    def ticks(self, about: int = 5) -> list[Tick]:
        """Round values inside the axis."""
        values = log_ticks(self.low, self.high) if self.log else round_ticks(self.low, self.high, about)
        return [Tick(float(self.pixels(value)), number(value)) for value in values]


@dataclass(frozen=True)
class Tick:
    """A labelled place on an axis."""

    at: float
    label: str


@dataclass(frozen=True)
class Line:
    """A curve: its points as SVG writes them, and the style's name."""

    points: str
    style: str


@dataclass(frozen=True)
class Marker:
    """A symbol with a text that appears when it is pointed at."""

    x: float
    y: float
    style: str
    title: str


@dataclass(frozen=True)
class Label:
    """A text beside a point, in pixels; ``anchor`` is the end of the text that stands there, as SVG names it."""

    x: float
    y: float
    text: str
    anchor: str = "middle"


@dataclass
class Panel:
    """One set of axes; curves and markers are given in values."""

    across: Axis
    axis: Axis
    label: str
    ticks: list[Tick]
    shows_zero: bool = False
    lines: list[Line] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)

    @property
    def top(self) -> float:
        """Upper edge in pixels."""
        return self.axis.end

    @property
    def height(self) -> float:
        """Height in pixels."""
        return self.axis.start - self.axis.end

    @property
    def zero(self) -> float | None:
        """Where zero lies in pixels, if it is shown."""
        return float(self.axis.pixels(0.0)) if self.shows_zero else None

    def draw(self, x: FloatArray, y: FloatArray, style: str) -> None:
        """Add a curve."""
        if len(x) == 0:
            return
        px, py = self.across.pixels(x), self.axis.pixels(y)
        kept = thin_curve(px, py, MOST_POINTS)
        self.lines.append(Line(" ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px[kept], py[kept], strict=True)), style))

    def point(self, x: float, y: float, style: str, title: str) -> None:
        """Add a symbol."""
        self.markers.append(Marker(float(self.across.pixels(x)), float(self.axis.pixels(y)), style, title))


@dataclass(frozen=True)
class Key:
    """An entry of the legend."""

    style: str
    label: str
    symbol: str = "line"


@dataclass(frozen=True)
class Band:
    """A shaded stretch of the horizontal axis."""

    start: float
    width: float
    label: str


@dataclass
class Chart:
    """Everything the template draws: panels one below the other over one horizontal axis."""

    name: str  # Unique on the page; letters, digits and hyphens.
    title: str  # With the description, for readers who do not see the drawing.
    across: Axis
    x_label: str
    description: str = ""
    keys: list[Key] = field(default_factory=list)
    panels: list[Panel] = field(default_factory=list)
    bands: list[Band] = field(default_factory=list)
    x_ticks: list[Tick] = field(default_factory=list)

    width = WIDTH
    left = LEFT
    right = WIDTH - RIGHT

    def __post_init__(self) -> None:
        self.x_ticks = self.x_ticks or self.across.ticks(8)

    @property
    def bottom(self) -> float:
        """Lower edge of the lowest panel in pixels."""
        return self.panels[-1].axis.start

    @property
    def height(self) -> float:
        """Height in pixels."""
        return self.bottom + BOTTOM

    def panel(self, label: str, limits: tuple[float, float], height: float, ticks: int = 4, log: bool = False) -> Panel:
        """Add a panel below the others; ``limits`` are the values at its lower and its upper edge."""
        low, high = limits
        if not high > low:
            margin = 0.05 * abs(low) or 1.0
            low, high = low - margin, high + margin
        top = self.bottom + GAP if self.panels else TOP
        axis = Axis(low, high, top + height, top, log)
        self.panels.append(Panel(self.across, axis, label, axis.ticks(ticks)))
        return self.panels[-1]

    def shade(self, start: float, end: float, label: str, least_width: float = 0.0) -> None:
        """Shade a stretch of the horizontal axis, with its label where it is wide enough for it, in pixels."""
        left, right = (float(self.across.pixels(value)) for value in (start, end))
        self.bands.append(Band(left, right - left, label if right - left > least_width else ""))


def horizontal(low: float, high: float) -> Axis:
    """The axis that all panels of a chart share."""
    return Axis(low, high if high > low else low + 1.0, LEFT, WIDTH - RIGHT)


def padded(low: float, high: float) -> tuple[float, float]:
    """A range with some air at both ends."""
    margin = 0.06 * _swing(low, high) or 0.05 * abs(low) or 1.0
    return low - margin, high + margin


def _swing(low: float, high: float) -> float:
    """By how much values differ; 0 where they differ by their rounding alone."""
    return high - low if high - low > ROUNDING * max(abs(low), abs(high)) else 0.0


def limits_around(curves: Sequence[FloatArray]) -> tuple[float, float]:
    """Ends of an axis that show the first curve well, and of the others what lies half its size beyond."""
    first = curves[0]
    low, high = float(first.min()), float(first.max())
    margin = 0.5 * _swing(low, high) or 0.1 * abs(low) or 0.1
    low = max(min(float(curve.min()) for curve in curves), low - margin)
    high = min(max(float(curve.max()) for curve in curves), high + margin)
    return padded(low, high)


def round_ticks(low: float, high: float, about: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten."""
    raw = (high - low) / max(about, 1)
    magnitude = 10.0 ** math.floor(math.log10(raw))
    step = next(size * magnitude for size in (1, 2, 2.5, 5, 10) if size * magnitude >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(place * step, 12) for place in range(first, math.floor(high / step + 1e-9) + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten, with 2 and 5 between them where there are few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    every = max(1, len(decades) // 7)
    sizes = (1.0, 2.0, 5.0) if len(decades) <= 3 else (1.0,)
    values = [size * 10.0**decade for decade in decades if decade % every == 0 for size in sizes]
    return [value for value in values if low * 0.999 <= value <= high * 1.001]
