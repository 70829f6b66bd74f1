"""``report.html`` of a discovery: where the model was wrong, what was added, and how the gap shrank."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.contracts.requests import Prediction
from ...core.discovery.localisation import LAYOUTS
from ...core.discovery.record_discovery import RecordDiscovery
from ...core.inference.current_offset import current_offset
from ...core.inference.observations import Observations
from ...core.inference.problem import Problem
from ...core.trajectory import FloatArray
from .base_parameters import base_parameters
from .chart import Chart, Key, horizontal, padded, residual_limit
from .discovery_lines import untried_line
from .templates import template
from .wording import time_unit

_VOLTAGE_HEIGHT, _RESIDUAL_HEIGHT = 210.0, 130.0


@dataclass(frozen=True, eq=False)
class _Figure:
    """One record, measured and simulated, with the residuals below."""

    name: str
    chart: Chart
    held_out: str  # Of a record that was held out, that it was, and what of it was fitted all the same; else empty.


def render(discovery: RecordDiscovery, problem: Problem) -> str:
    """The page as HTML: no scripts, nothing loaded from elsewhere; the problem draws the curves again."""
    return template("record_discovery.html.j2").render(
        d=discovery.to_json(),
        layouts=LAYOUTS,
        figures=[*_fitted(discovery, problem), *_held_out(discovery, problem)],
        with_effect=bool(discovery.findings.best.effects),
        base=base_parameters(discovery, problem),
        untried=untried_line(discovery),
    )


def _fitted(discovery: RecordDiscovery, problem: Problem) -> list[_Figure]:
    found = discovery.findings
    before = problem.predict((), found.gap.nearest.fit.candidate)
    after = problem.predict(found.best.effects, found.best.fit.candidate) if found.best.effects else None
    if before is None:
        return []
    last: Sequence[Prediction | None] = after or [None] * len(before)
    rows = zip(problem.observations, before, last, strict=True)
    return [
        _figure(f"record-{place}", observed, base.voltage, None if augmented is None else augmented.voltage)
        for place, (observed, base, augmented) in enumerate(rows)
    ]


def _held_out(discovery: RecordDiscovery, problem: Problem) -> list[_Figure]:
    """The hold-out records, as their errors were told; none where the base model cannot be simulated over them."""
    best, before = discovery.findings.best, discovery.findings.gap.nearest.held_errors
    if not before:
        return []
    last: Sequence[FloatArray | None] = (best.held_errors if best.effects else ()) or [None] * len(before)
    rows = zip(problem.held_observations, before, last, strict=True)
    figures = []
    for place, (observed, base, augmented) in enumerate(rows):
        after = None if augmented is None else observed.voltage - augmented
        offset = current_offset(observed.measured_record)
        fitted = "its initial state of charge" + " and an offset of its current" * (offset is not None)
        remark = f"Held out: no more than {fitted} was fitted to this record."
        figures.append(_figure(f"held-out-{place}", observed, observed.voltage - base, after, remark))
    return figures


def _figure(
    name: str, observed: Observations, base: FloatArray, augmented: FloatArray | None, held_out: str = ""
) -> _Figure:
    """The figure of a record, from the voltage of the base model and of that with the effect, V."""
    simulated = {"initial": base} | ({} if augmented is None else {"best": augmented})
    scale, unit = time_unit(float(observed.time[-1]))
    time, measured = observed.time / scale, observed.voltage
    residuals = {style: 1e3 * (values - measured) for style, values in simulated.items()}
    labels = {"initial": "base model", "best": "base model with the effect"}
    chart = Chart(
        name,
        "Voltage and residuals over time",
        horizontal(float(time[0]), float(time[-1])),
        f"Time / {unit}",
        "Measured and simulated voltage.",
        [Key("measured", "measured"), *(Key(style, labels[style]) for style in simulated)],
    )
    limits = padded(float(np.min(measured)), float(np.max(measured)))
    voltage = chart.panel("Voltage / V", limits, _VOLTAGE_HEIGHT, ticks=5)
    size = residual_limit(list(residuals.values()), 1.0)
    residual = chart.panel("Residual / mV", (-size, size), _RESIDUAL_HEIGHT)
    residual.shows_zero = True
    voltage.draw(time, measured, "measured")
    for style, values in simulated.items():
        voltage.draw(time, values, style)
        residual.draw(time, residuals[style], style)
    return _Figure(observed.name, chart, held_out)
