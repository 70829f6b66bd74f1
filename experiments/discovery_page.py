"""``report.html`` of a discovery: where the model was wrong, what was added, and how the gap shrank."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from ..core.discovery.discovery import Discovery
from ..core.discovery.problem import Problem
from ..core.files import write_text
from ..core.trajectory import FloatArray

_TEMPLATE = Path(__file__).with_name("discovery_page.html.j2")
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 760.0, 190.0, 52.0, 28.0


def write_page(path: Path, discovery: Discovery, problem: Problem | None) -> None:
    """Write the page: one file, no scripts, nothing loaded from elsewhere.

    Parameters
    ----------
    path : Path
        Where to.
    discovery : Discovery
        What was found.
    problem : Problem or None
        Draws the curves again; None leaves the figures out.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["zip"] = zip
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    content = discovery.to_json()
    figures = [] if problem is None else _figures(discovery, problem)
    write_text(path, template.render(d=content, figures=figures, css=_css()))


def _css() -> str:
    shared = Path(__file__).with_name("report") / "report.css"
    return shared.read_text(encoding="utf-8") if shared.exists() else ""


def _figures(discovery: Discovery, problem: Problem) -> list[dict[str, Any]]:
    found = discovery.findings
    before = problem.predict((), found.nearest_base.fit.candidate)
    after = problem.predict(found.best.effects, found.best.fit.candidate)
    if before is None or after is None:
        return []
    figures = []
    for observed, first, last in zip(problem.observations, before, after, strict=True):
        hours = observed.time / 3600
        voltage = {"measured": observed.voltage, "base model": first.voltage, "augmented": last.voltage}
        residual = {
            "base model": 1e3 * (observed.voltage - first.voltage),
            "augmented": 1e3 * (observed.voltage - last.voltage),
        }
        figures.append(
            {
                "title": observed.name,
                "voltage": Markup(_chart(hours, voltage, "voltage / V")),
                "residual": Markup(_chart(hours, residual, "measured - simulated / mV")),
            }
        )
    return figures


_COLOURS = {"measured": "#444444", "base model": "#c0562b", "augmented": "#1f6fb2"}


def _chart(x: FloatArray, curves: dict[str, FloatArray], label: str) -> str:
    """A small line chart as SVG."""
    everything = np.concatenate(list(curves.values()))
    low, high = float(np.min(everything)), float(np.max(everything))
    pad = 0.05 * max(high - low, 1e-9)
    low, high = low - pad, high + pad
    start, end = float(x[0]), float(x[-1]) if x[-1] > x[0] else float(x[0]) + 1.0
    right, top = _WIDTH - 8, 8.0
    base = _HEIGHT - _BOTTOM

    def place(values: FloatArray) -> str:
        px = _LEFT + (x - start) / (end - start) * (right - _LEFT)
        py = base - (values - low) / (high - low) * (base - top)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))

    parts = [f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="{html.escape(label)}">']
    for k in range(5):
        value = low + (high - low) * k / 4
        y = base - (base - top) * k / 4
        parts.append(f'<line x1="{_LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{y + 3:.1f}" font-size="10" text-anchor="end">{value:.4g}</text>')
        moment = start + (end - start) * k / 4
        px = _LEFT + (right - _LEFT) * k / 4
        parts.append(f'<text x="{px:.1f}" y="{base + 13}" font-size="10" text-anchor="middle">{moment:.3g}</text>')
    for name, values in curves.items():
        colour = _COLOURS[name]
        parts.append(f'<polyline points="{place(values)}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
    legend = _LEFT + 6
    for name in curves:
        parts.append(f'<text x="{legend}" y="{_HEIGHT - 3}" font-size="11" fill="{_COLOURS[name]}">{name}</text>')
        legend += 90
    parts.append(f'<text x="{right}" y="{_HEIGHT - 3}" font-size="11" text-anchor="end">{label}, time / h</text>')
    return "".join(parts) + "</svg>"
