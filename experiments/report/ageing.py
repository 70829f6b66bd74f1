"""The figures of a life: capacity and resistance by cycle, and what the best simulation says was lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.ageing.choice import knee, levelling
from ...core.ageing.cycle_table import LOSSES, CycleTable
from ...core.ageing.fade_band import CAPACITY, FadeBand
from ...core.prediction import Prediction
from ...core.task import Experiment
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from ..run_record import RunRecord
from .chart import BOTTOM, GAP, TOP, Axis, Band, Chart, Key, Marker, Panel, horizontal, padded, vertical
from .wording import number

_CAPACITY_HEIGHT, _OTHER_HEIGHT = 230.0, 120.0

_LOST = dict(zip(LOSSES, ("lithium", "negative material", "positive material"), strict=True))
_LOSS_STYLES = dict(zip(LOSSES, ("best", "initial", "limit"), strict=True))

_FEW = 10

_NOTHING_PCT = 1e-3
"""A loss below this is none: the integrator's own error."""


@dataclass(frozen=True, eq=False)
class Life:
    """One long record with its simulations."""

    name: str  # The record's. Untrusted.
    chart: Chart  # Capacity above resistance above losses, by cycle.
    remark: str  # What the reader must know to read it, and what it comes to.


@dataclass(frozen=True, eq=False)
class _Simulated:
    """What is drawn of a life beside what was measured."""

    best: CycleTable | None
    initial: CycleTable | None = None
    fade: FadeBand | None = None
    later: CycleTable | None = None  # Measured cycles that were not fitted.
    told: str = ""


def lives(run: RunRecord) -> list[Life]:
    """One figure for each life, forecast of its later cycles included; none of another task."""
    if not run.task.long:
        return []
    forecasts = {one.errors.record: one for one in run.held_out if one.curve is not None}
    found = []
    for place, experiment in enumerate(run.task.experiments):
        later = next((e for e in run.task.held_out if _cell(e) == _cell(experiment) and e.name in forecasts), None)
        forecast = None if later is None else forecasts.pop(later.name)
        found.append(_life(f"life-{place}", experiment, _fitted(run, place, later, forecast)))
    others = [experiment for experiment in run.task.held_out if experiment.name in forecasts]
    return found + [
        _life(f"life-held-out-{place}", experiment, _forecast(forecasts[experiment.name], None, None))
        for place, experiment in enumerate(others)
    ]


def _cell(experiment: Experiment) -> str:
    """What records of one life have in common, in whose names their cycles follow."""
    return experiment.name.rpartition(", cycles ")[0] or experiment.name


def _fitted(run: RunRecord, place: int, later: Experiment | None, forecast: Prediction | None) -> _Simulated:
    best, initial = _table(run.best, place), _table(run.initial, place)
    initial = initial if run.best is not run.initial or forecast is not None else None
    if forecast is not None and later is not None:
        return _forecast(forecast, initial, later.target.cycle_table)
    fade = run.analysis.fade[place] if run.analysis is not None and place < len(run.analysis.fade) else None
    if run.best is run.initial:
        return _Simulated(None, best, fade)
    return _Simulated(best, initial, fade)


def _forecast(prediction: Prediction, initial: CycleTable | None, later: CycleTable | None) -> _Simulated:
    assert prediction.curve is not None
    error, band = prediction.errors.signals.get(CAPACITY), prediction.bands.get(CAPACITY)
    told = ""
    if error is not None:
        told = f" In the cycles that were not fitted it is off by {number(error.rms)} % of the first capacity rms"
        told += f", {number(error.max)} % at most"
        told += "." if band is None else f"; the 95 % band holds {number(100 * band.inside, 2)} % of them."
    return _Simulated(prediction.curve.cycle_table, initial, prediction.fade, later, told)


def _life(name: str, experiment: Experiment, simulated: _Simulated) -> Life:
    measured = experiment.target.cycle_table
    assert measured is not None
    curves = {"initial": simulated.initial, "best": simulated.best}
    tables = {"measured": measured, **{style: table for style, table in curves.items() if table is not None}}
    later = simulated.later
    across = horizontal(0.0, float((measured if later is None else later).cycle[-1]))
    drawn = list(tables.items())
    if later is not None:
        drawn.append(("measured", later))
    base = simulated.best or simulated.initial
    limits = [] if simulated.fade is None or base is None else _limits(base, simulated.fade)
    panels = [_panel("Capacity / A h", "capacity_ah", drawn, across, TOP, _CAPACITY_HEIGHT, [y for _, y in limits])]
    keys = [Key(style, style) for style in tables]
    if limits:
        for cycles, edge in limits:
            panels[0].draw(across, cycles, edge, "limit")
        keys.append(Key("limit", "95 % band of a single cycle"))
    for cycle in experiment.detailed_cycles:
        height = float(measured.at(np.array([float(cycle)]))[0])
        if np.isfinite(height):
            x, y = float(across.pixels(float(cycle))), float(panels[0].axis.pixels(height))
            panels[0].markers.append(Marker(x, y, "warm-up", f"Cycle {cycle}: compared by its curves"))
    if any(np.any(np.isfinite(table.resistance_ohm)) for _, table in drawn):
        top = panels[-1].top + panels[-1].height + GAP
        panels.append(_panel("Resistance / Ω", "resistance_ohm", drawn, across, top, _OTHER_HEIGHT))
    best = simulated.best
    losses = {name: getattr(best, name) for name in LOSSES} if best is not None else {}
    losses = {name: lost for name, lost in losses.items() if np.nanmax(lost, initial=0.0) > _NOTHING_PCT}
    keys.append(Key("warm-up", "compared by its curves", "dot"))
    if losses and best is not None:
        top = panels[-1].top + panels[-1].height + GAP
        panels.append(_losses(best, losses, across, top))
        keys += [Key(_LOSS_STYLES[name], f"lowest panel: {_LOST[name]}") for name in losses]
    said = _said(measured, base if best is None else best) + simulated.told
    return Life(
        experiment.name,
        Chart(
            name=name,
            title="Capacity, resistance and losses by cycle",
            description=said,
            panels=panels,
            x_ticks=across.ticks(8),
            x_label="Cycle",
            keys=keys,
            height=panels[-1].top + panels[-1].height + BOTTOM,
            bands=_not_fitted(measured, later, across),
        ),
        " ".join([said, *_said_of_losses(losses)]),
    )


def _limits(base: CycleTable, fade: FadeBand) -> list[tuple[FloatArray, FloatArray]]:
    """The lower and the upper edge of the band about a simulated fade: cycles and capacities."""
    cycles = np.array(fade.cycle)
    middle, half = base.at(cycles), np.array(fade.half_ah)
    there = np.isfinite(middle)
    return [(cycles[there], (middle + side * half)[there]) for side in (-1.0, 1.0)]


def _not_fitted(measured: CycleTable, later: CycleTable | None, across: Axis) -> list[Band]:
    if later is None:
        return []
    start, end = (float(across.pixels(float(cycle))) for cycle in (measured.cycle[-1], later.cycle[-1]))
    return [Band(start, end - start, "not fitted")]


def _table(trial: Trial, place: int) -> CycleTable | None:
    curve = trial.curves[place] if place < len(trial.curves) else None
    return None if curve is None else curve.cycle_table


def _panel(
    label: str,
    column: str,
    tables: list[tuple[str, CycleTable]],
    across: Axis,
    top: float,
    height: float,
    beside: Sequence[FloatArray] = (),
) -> Panel:
    values = [getattr(table, column) for _, table in tables]
    known = np.concatenate([found[np.isfinite(found)] for found in (*values, *beside)])
    axis = vertical(*padded(float(known.min()), float(known.max())), top, height)
    panel = Panel(axis, label, ticks=axis.ticks(4))
    for (style, table), found in zip(tables, values, strict=True):
        there = np.isfinite(found)
        panel.draw(across, table.cycle[there], found[there], style)
        # A line through so few points cannot be seen.
        if np.count_nonzero(there) < _FEW:
            for cycle, value in zip(table.cycle[there], found[there], strict=True):
                x, y = float(across.pixels(float(cycle))), float(axis.pixels(float(value)))
                panel.markers.append(Marker(x, y, style, f"Cycle {cycle:.0f}: {number(float(value))}"))
    return panel


def _losses(best: CycleTable, losses: dict[str, FloatArray], across: Axis, top: float) -> Panel:
    largest = max(float(np.nanmax(lost)) for lost in losses.values())
    axis = vertical(0.0, 1.06 * largest, top, _OTHER_HEIGHT)
    panel = Panel(axis, "Lost / %", ticks=axis.ticks(4))
    for name, lost in losses.items():
        panel.draw(across, best.cycle, lost, _LOSS_STYLES[name])
        last = float(across.pixels(float(best.cycle[-1])))
        title = f"{_LOST[name]}: {number(lost[-1])} %"
        panel.markers.append(Marker(last, float(axis.pixels(lost[-1])), "search", title))
    return panel


def _said(measured: CycleTable, best: CycleTable | None) -> str:
    first, last = measured.capacity_ah[[0, -1]]
    text = (
        f"Over {measured.cycle[-1]:.0f} cycles the measured capacity goes from {number(float(first))} to "
        f"{number(float(last))} A h"
    )
    bends = [f"turns steeper at cycle {knee(measured)}"] * (knee(measured) is not None)
    bends += [f"levels off from cycle {levelling(measured)}"] * (levelling(measured) is not None)
    text += f"; the fade {' and '.join(bends)}." if bends else "."
    if best is not None:
        off = best.at(measured.cycle) - measured.capacity_ah
        if np.any(np.isfinite(off)):
            text += f" The best simulation is off by {number(100.0 * float(np.nanmax(np.abs(off)) / first))} % at most."
    return text


def _said_of_losses(losses: dict[str, FloatArray]) -> list[str]:
    if not losses:
        return []
    told = ", ".join(f"{number(float(lost[-1]))} % of the {_LOST[name]}" for name, lost in losses.items())
    return [f"In the best simulation {told} is lost at the end (lowest panel)."]
