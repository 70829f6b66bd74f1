"""The figures of a life: capacity and resistance by cycle, and what the best simulation says was lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.ageing.choice import knee, levelling
from ...core.ageing.cycle_table import LOSSES, CycleTable
from ...core.task import Experiment
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from ..run_record import RunRecord
from .chart import BOTTOM, GAP, TOP, Axis, Chart, Key, Marker, Panel, horizontal, padded, vertical
from .wording import number

_CAPACITY_HEIGHT, _OTHER_HEIGHT = 230.0, 120.0

_LOST = dict(zip(LOSSES, ("lithium", "negative material", "positive material"), strict=True))
_LOSS_STYLES = dict(zip(LOSSES, ("best", "initial", "measured"), strict=True))

_NOTHING_PCT = 1e-3
"""A loss below this is none: the integrator's own error."""


@dataclass(frozen=True, eq=False)
class Life:
    """One long record with its simulations."""

    chart: Chart  # Capacity above resistance above losses, by cycle.
    remark: str  # What the reader must know to read it, and what it comes to.


def lives(run: RunRecord) -> list[Life]:
    """One figure for each long record; none of another task."""
    return [_life(run, place, experiment) for place, experiment in enumerate(run.task.experiments) if experiment.long]


def _life(run: RunRecord, place: int, experiment: Experiment) -> Life:
    measured = experiment.target.cycle_table
    assert measured is not None
    best, initial = _table(run.best, place), _table(run.initial, place)
    simulated = {"initial": initial} | ({"best": best} if run.best is not run.initial else {})
    tables = {"measured": measured, **{style: table for style, table in simulated.items() if table is not None}}
    across = horizontal(0.0, float(measured.cycle[-1]))
    panels = [_panel("Capacity / A h", "capacity_ah", tables, across, TOP, _CAPACITY_HEIGHT)]
    for cycle in experiment.detailed_cycles:
        height = float(measured.at(np.array([float(cycle)]))[0])
        if np.isfinite(height):
            x, y = float(across.pixels(float(cycle))), float(panels[0].axis.pixels(height))
            panels[0].markers.append(Marker(x, y, "warm-up", f"Cycle {cycle}: compared by its curves"))
    if any(np.any(np.isfinite(table.resistance_ohm)) for table in tables.values()):
        top = panels[-1].top + panels[-1].height + GAP
        panels.append(_panel("Resistance / Ω", "resistance_ohm", tables, across, top, _OTHER_HEIGHT))
    losses = {name: getattr(best, name) for name in LOSSES} if best is not None else {}
    losses = {name: lost for name, lost in losses.items() if np.nanmax(lost, initial=0.0) > _NOTHING_PCT}
    keys = [Key(style, style) for style in tables] + [Key("warm-up", "compared by its curves", "dot")]
    if losses and best is not None:
        top = panels[-1].top + panels[-1].height + GAP
        panels.append(_losses(best, losses, across, top))
    return Life(
        Chart(
            name=f"life-{place}",
            title="Capacity, resistance and losses by cycle",
            description=_said(measured, best),
            panels=panels,
            x_ticks=across.ticks(8),
            x_label="Cycle",
            keys=keys,
            height=panels[-1].top + panels[-1].height + BOTTOM,
        ),
        " ".join([_said(measured, best), *_said_of_losses(losses)]),
    )


def _table(trial: Trial, place: int) -> CycleTable | None:
    curve = trial.curves[place] if place < len(trial.curves) else None
    return None if curve is None else curve.cycle_table


def _panel(label: str, column: str, tables: dict[str, CycleTable], across: Axis, top: float, height: float) -> Panel:
    values = {style: getattr(table, column) for style, table in tables.items()}
    known = np.concatenate([found[np.isfinite(found)] for found in values.values()])
    axis = vertical(*padded(float(known.min()), float(known.max())), top, height)
    panel = Panel(axis, label, ticks=axis.ticks(4))
    for style, table in tables.items():
        there = np.isfinite(values[style])
        panel.draw(across, table.cycle[there], values[style][there], style)
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
    return [f"In the best simulation {told} is lost at the end (lowest panel; point at a line's end for its name)."]
