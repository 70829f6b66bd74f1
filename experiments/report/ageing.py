"""The figures of a life: capacity and resistance by cycle, and what the best simulation says was lost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.ageing.choice import knee, levelling
from ...core.ageing.cycle_table import LOSSES, CycleTable
from ...core.ageing.fade_band import CAPACITY, FadeBand
from ...core.inference.prediction import Prediction
from ...core.task import Experiment
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from ..run_record import RunRecord
from .chart import Chart, Key, Panel, horizontal, padded
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
        initial = _table(run.initial, place)
        later = next((e for e in run.task.held_out if _cell(e) == _cell(experiment) and e.name in forecasts), None)
        if later is not None:
            simulated = _forecast(forecasts.pop(later.name), initial, later.target.cycle_table)
        else:
            # Where nothing is better than the start, one curve is drawn, as the initial one.
            best = None if run.best is run.initial else _table(run.best, place)
            fades = () if run.analysis is None else run.analysis.fade
            simulated = _Simulated(best, initial, fades[place] if place < len(fades) else None)
        found.append(_life(f"life-{place}", experiment, simulated))
    others = [experiment for experiment in run.task.held_out if experiment.name in forecasts]
    return found + [
        _life(f"life-held-out-{place}", experiment, _forecast(forecasts[experiment.name], None, None))
        for place, experiment in enumerate(others)
    ]


def _cell(experiment: Experiment) -> str:
    """What records of one life have in common, in whose names their cycles follow."""
    return experiment.name.rpartition(", cycles ")[0] or experiment.name


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
    measured, later, best = experiment.target.cycle_table, simulated.later, simulated.best
    assert measured is not None
    curves = {"initial": simulated.initial, "best": best}
    tables = {"measured": measured, **{style: table for style, table in curves.items() if table is not None}}
    drawn = [*tables.items(), *([] if later is None else [("measured", later)])]
    across = horizontal(0.0, float((measured if later is None else later).cycle[-1]))
    chart = Chart(name, "Capacity, resistance and losses by cycle", across, "Cycle")
    chart.keys += [Key(style, style) for style in tables]
    base = best or simulated.initial
    limits = [] if simulated.fade is None or base is None else _limits(base, simulated.fade)
    capacity = _draw(chart, "Capacity / A h", "capacity_ah", drawn, _CAPACITY_HEIGHT, [y for _, y in limits])
    for cycles, edge in limits:
        capacity.draw(cycles, edge, "limit")
    if limits:
        chart.keys.append(Key("limit", "95 % band of a single cycle"))
    for cycle in experiment.detailed_cycles:
        height = float(measured.at(np.array([float(cycle)]))[0])
        if np.isfinite(height):
            capacity.point(cycle, height, "warm-up", f"Cycle {cycle}: compared by its curves")
    chart.keys.append(Key("warm-up", "compared by its curves", "dot"))
    if any(np.any(np.isfinite(table.resistance_ohm)) for _, table in drawn):
        _draw(chart, "Resistance / Ω", "resistance_ohm", drawn, _OTHER_HEIGHT)
    losses = {} if best is None else {name: getattr(best, name) for name in LOSSES}
    losses = {name: lost for name, lost in losses.items() if np.nanmax(lost, initial=0.0) > _NOTHING_PCT}
    if losses and best is not None:
        _draw_losses(chart, best.cycle, losses)
    if later is not None:
        chart.shade(measured.cycle[-1], later.cycle[-1], "not fitted")
    chart.description = _said(measured, base) + simulated.told
    return Life(experiment.name, chart, " ".join([chart.description, *_said_of_losses(losses)]))


def _limits(base: CycleTable, fade: FadeBand) -> list[tuple[FloatArray, FloatArray]]:
    """The lower and the upper edge of the band about a simulated fade: cycles and capacities."""
    cycles = np.array(fade.cycle)
    middle, half = base.at(cycles), np.array(fade.half_ah)
    there = np.isfinite(middle)
    return [(cycles[there], (middle + side * half)[there]) for side in (-1.0, 1.0)]


def _table(trial: Trial, place: int) -> CycleTable | None:
    curve = trial.curves[place] if place < len(trial.curves) else None
    return None if curve is None else curve.cycle_table


def _draw(
    chart: Chart,
    label: str,
    column: str,
    tables: list[tuple[str, CycleTable]],
    height: float,
    beside: Sequence[FloatArray] = (),
) -> Panel:
    """A panel with a column of each table; its axis holds what is drawn beside them too."""
    values = [getattr(table, column) for _, table in tables]
    known = np.concatenate([found[np.isfinite(found)] for found in (*values, *beside)])
    panel = chart.panel(label, padded(float(known.min()), float(known.max())), height)
    for (style, table), found in zip(tables, values, strict=True):
        there = np.isfinite(found)
        panel.draw(table.cycle[there], found[there], style)
        # A line through so few points cannot be seen.
        if np.count_nonzero(there) < _FEW:
            for cycle, value in zip(table.cycle[there], found[there], strict=True):
                panel.point(cycle, value, style, f"Cycle {cycle:.0f}: {number(float(value))}")
    return panel


def _draw_losses(chart: Chart, cycle: FloatArray, losses: dict[str, FloatArray]) -> None:
    largest = max(float(np.nanmax(lost)) for lost in losses.values())
    panel = chart.panel("Lost / %", (0.0, 1.06 * largest), _OTHER_HEIGHT)
    for name, lost in losses.items():
        panel.draw(cycle, lost, _LOSS_STYLES[name])
        panel.point(cycle[-1], lost[-1], "search", f"{_LOST[name]}: {number(lost[-1])} %")
        chart.keys.append(Key(_LOSS_STYLES[name], f"lowest panel: {_LOST[name]}"))


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
