"""Charts as plain geometry: panels over one horizontal axis, in pixels, ready for the SVG template."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...core.trajectory import FloatArray
from .thinning import thin_curve
from .wording import number

WIDTH, LEFT, RIGHT, TOP, BOTTOM, GAP = 880.0, 64.0, 14.0, 8.0, 40.0, 16.0
MOST_POINTS = 400
_FAR = 5000.0


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


@dataclass
class Panel:
    """One set of axes."""

    axis: Axis
    label: str
    lines: list[Line] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)
    ticks: list[Tick] = field(default_factory=list)
    zero: float | None = None

    @property
    def top(self) -> float:
        """Upper edge in pixels."""
        return self.axis.end

    @property
    def height(self) -> float:
        """Height in pixels."""
        return self.axis.start - self.axis.end

    def draw(self, across: Axis, x: FloatArray, y: FloatArray, style: str) -> None:
        """Add a curve."""
        if len(x) == 0:
            return
        px, py = across.pixels(x), self.axis.pixels(y)
        kept = thin_curve(px, py, MOST_POINTS)
        self.lines.append(Line(" ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px[kept], py[kept], strict=True)), style))


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


@dataclass(frozen=True)
class Chart:
    """Everything the template draws."""

    name: str  # Unique on the page; letters, digits and hyphens.
    # title, description: For readers who do not see the drawing.
    title: str
    description: str
    panels: Sequence[Panel]
    x_ticks: Sequence[Tick]
    x_label: str
    keys: Sequence[Key]
    height: float
    bands: Sequence[Band] = ()
    width: float = WIDTH
    left: float = LEFT
    right: float = WIDTH - RIGHT


def horizontal(low: float, high: float) -> Axis:
    """The axis that all panels of a chart share."""
    return Axis(low, high if high > low else low + 1.0, LEFT, WIDTH - RIGHT)


def vertical(low: float, high: float, top: float, height: float, log: bool = False) -> Axis:
    """The axis of a panel."""
    if not high > low:
        margin = 0.05 * abs(low) or 1.0
        low, high = low - margin, high + margin
    return Axis(low, high, top + height, top, log)


def padded(low: float, high: float, share: float = 0.06) -> tuple[float, float]:
    """A range with some air at both ends."""
    margin = share * (high - low) or 0.05 * abs(low) or 1.0
    return low - margin, high + margin


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
