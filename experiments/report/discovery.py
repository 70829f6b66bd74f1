"""``report.html`` of a discovery: where the model was wrong, what was added, and how the gap shrank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.discovery.observations import Observations
from ...core.discovery.problem import Problem
from ...core.discovery.record_discovery import RecordDiscovery
from ...core.discovery.simulator import Prediction
from ...core.trajectory import FloatArray
from .chart import BOTTOM, GAP, TOP, Chart, Key, Panel, horizontal, padded, vertical
from .templates import template
from .wording import number, time_unit

_VOLTAGE_HEIGHT, _RESIDUAL_HEIGHT = 210.0, 130.0

VERDICTS = {
    "effect-found": "An effect explains the discrepancy",
    "ambiguous": "Several effects explain the discrepancy equally well",
    "unexplained": "A discrepancy remains that no effect of the catalogue explains",
    "no-missing-effect": "Nothing is missing: noise explains what the base model leaves",
}


@dataclass(frozen=True, eq=False)
class _Figure:
    """One record, measured and simulated, with the residuals below."""

    name: str
    chart: Chart


def render(discovery: RecordDiscovery, problem: Problem) -> str:
    """The page as HTML: no scripts, nothing loaded from elsewhere; the problem draws the curves again."""
    figures = _figures(discovery, problem)
    content = discovery.to_json()
    return template("record_discovery.html.j2").render(d=content, headline=VERDICTS[discovery.verdict], figures=figures)


def _figures(discovery: RecordDiscovery, problem: Problem) -> list[_Figure]:
    found = discovery.findings
    before = problem.predict((), found.nearest_base.fit.candidate)
    after = problem.predict(found.best.effects, found.best.fit.candidate) if found.best.effects else None
    if before is None:
        return []
    last: Sequence[Prediction | None] = after or [None] * len(before)
    rows = zip(problem.observations, before, last, strict=True)
    return [_figure(place, *row) for place, row in enumerate(rows)]


def _figure(place: int, observed: Observations, base: Prediction, augmented: Prediction | None) -> _Figure:
    simulated = {"initial": base.voltage} | ({} if augmented is None else {"best": augmented.voltage})
    scale, unit = time_unit(float(observed.time[-1]))
    time = observed.time / scale
    across = horizontal(float(time[0]), float(time[-1]))
    measured = observed.voltage
    axis = vertical(*padded(float(np.min(measured)), float(np.max(measured))), TOP, _VOLTAGE_HEIGHT)
    voltage = Panel(axis, "Voltage / V", ticks=axis.ticks(5))
    voltage.draw(across, time, measured, "measured")
    residuals = {style: 1e3 * (values - measured) for style, values in simulated.items()}
    residual = _residual_panel(residuals, TOP + _VOLTAGE_HEIGHT + GAP)
    for style, values in simulated.items():
        voltage.draw(across, time, values, style)
        residual.draw(across, time, residuals[style], style)
    labels = {"initial": "base model", "best": "base model with the effect"}
    rms = [f"{labels[style]} {number(float(np.sqrt(np.mean(r**2))))} mV" for style, r in residuals.items()]
    return _Figure(
        observed.name,
        Chart(
            name=f"record-{place}",
            title="Voltage and residuals over time",
            description=f"Measured and simulated voltage. Residuals, root mean square: {', '.join(rms)}.",
            panels=[voltage, residual],
            x_ticks=across.ticks(8),
            x_label=f"Time / {unit}",
            keys=[Key("measured", "measured"), *(Key(style, labels[style]) for style in simulated)],
            height=residual.top + residual.height + BOTTOM,
        ),
    )


def _residual_panel(residuals: dict[str, FloatArray], top: float) -> Panel:
    # A cell that is empty a moment early is a spike of a volt: the scale serves the rest.
    largest = max(float(np.percentile(np.abs(values), 98)) for values in residuals.values())
    size = max(1.3 * largest, 1.0)
    axis = vertical(-size, size, top, _RESIDUAL_HEIGHT)
    return Panel(axis, "Residual / mV", ticks=axis.ticks(4), zero=float(axis.pixels(0.0)))
