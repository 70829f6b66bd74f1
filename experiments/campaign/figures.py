"""Figures of a campaign as SVG: distributions by mode and by rate, convergence with bands, error against effort."""

import io
import math
import re
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from ...core.trajectory import FloatArray
from .statistics import FLOOR
from .store import Store
from .summary import Row, grouped
from .tables import EFFORT, label_of
from .trace import read_trace

_MOST_DOTS = 400
_COLOURS = (
    "#0b5cad",
    "#b45309",
    "#17693b",
    "#8b3d88",
    "#a8321f",
    "#4b6584",
    "#7a8b00",
    "#00808a",
    "#c2185b",
    "#555555",
)


def draw_all(rows: Sequence[Row], store: Store, metric: str = "mape") -> dict[str, str]:
    """Every figure that the results allow, by name. The traces of the runs lie in the store."""
    done = [row for row in rows if row["state"] == "done" and row[metric] is not None]
    if not done:
        return {}
    figures = {
        "by-mode": distributions(done, "mode", metric),
        "by-chemistry": distributions(done, "chemistry", metric),
        "by-rate": distributions(done, "rates", metric),
        "convergence": convergence(done, store),
        "effort": pareto(done, metric),
    }
    return {name: svg for name, svg in figures.items() if svg}


def distributions(rows: Sequence[Row], group: str, metric: str) -> str:
    """Box plots on a logarithmic axis, a panel a group, a box a method, a dot a cell; empty for no groups."""
    groups = list(dict.fromkeys(row[group] for row in rows if row[group]))
    methods = list(grouped(rows, "method"))
    if not groups or (group != "mode" and len(groups) < 2):
        return ""
    across = min(len(groups), 5)
    width = max(1.7, 0.42 * len(methods) + 0.9)
    figure, panels = _panels(len(groups), _on_axis(metric), across, width=width)
    for panel, name in zip(panels, groups, strict=True):
        columns = [
            [max(row[metric], FLOOR) for row in rows if row[group] == name and row["method"] == method]
            for method in methods
        ]
        places = list(range(1, len(methods) + 1))
        panel.boxplot(
            columns, positions=places, showfliers=False, widths=0.6, medianprops={"color": "#1d2126", "linewidth": 1.4}
        )
        for place, (column, colour) in enumerate(zip(columns, cycle(_COLOURS), strict=False), start=1):
            dots = column[:_MOST_DOTS]
            # Spread sideways, evenly and always the same.
            shift = 0.18 * ((np.arange(len(dots)) * 0.618) % 1.0 - 0.5)
            panel.plot(place + shift, dots, ".", markersize=4, alpha=0.55, color=colour)
        panel.set_xticks(places, methods, rotation=50, ha="right", rotation_mode="anchor")
        panel.set_yscale("log")
        panel.set_title(name, fontsize=10)
    return _svg(figure, f"by-{group}")


def convergence(rows: Sequence[Row], store: Store) -> str:
    """Median of the best error so far over the simulations, with a band from quartile to quartile."""
    modes = list(dict.fromkeys(row["mode"] for row in rows))
    methods = list(grouped(rows, "method"))
    figure, panels = _panels(len(modes), f"{_of_objective(rows)}, best so far")
    for panel, mode in zip(panels, modes, strict=True):
        for method, colour in zip(methods, cycle(_COLOURS), strict=False):
            own = [row["identity"] for row in rows if (row["mode"], row["method"]) == (mode, method)]
            traces = [trace for identity in own if (trace := read_trace(store.cell(identity)).objective)]
            if not traces:
                continue
            low, middle, high = _quartiles(traces)
            x = np.arange(1, len(middle) + 1)
            panel.fill_between(x, low, high, step="post", color=colour, alpha=0.13, linewidth=0)
            panel.step(x, middle, where="post", color=colour, linewidth=1.6, label=method)
        panel.set_yscale("log")
        panel.set_xlabel("simulations")
        panel.set_title(mode, fontsize=10)
    _legend(panels)
    return _svg(figure, "convergence")


def _of_objective(rows: Sequence[Row]) -> str:
    """What the runs minimised, with its unit, where it is the same error in all."""
    for name in ("mape", "v_rmse_mv"):
        if all(row["objective"] == row[name] for row in rows):
            return _on_axis(name)
    has_its_own = any(row["mape"] is not None or row["v_rmse_mv"] is not None for row in rows)
    return "objective" if has_its_own else _on_axis("objective")


def _quartiles(traces: Sequence[Sequence[float | None]]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Quartiles of the best so far; a run that stopped early keeps what it had, as its user does."""
    length = max(map(len, traces))
    best = np.full((len(traces), length), np.inf)
    for place, trace in enumerate(traces):
        known = np.array([math.inf if value is None else max(value, FLOOR) for value in trace])
        best[place, : len(known)] = np.minimum.accumulate(known)
        best[place, len(known) :] = best[place, len(known) - 1]
    # Runs without any result yet count as worse than all others.
    best[~np.isfinite(best)] = np.nanmax(best[np.isfinite(best)], initial=FLOOR)
    low, middle, high = np.quantile(best, (0.25, 0.5, 0.75), axis=0)
    return low, middle, high


def pareto(rows: Sequence[Row], metric: str) -> str:
    """Median error against simulations, time, tokens and cost, a point a method; what nothing beats is joined."""
    columns = ("simulations", "wall_s", "tokens", "cost_usd")
    axes = [name for name in columns if any((row[name] or 0) > 0 for row in rows)]
    methods = list(grouped(rows, "method"))
    if not axes or len(methods) < 2:
        return ""
    figure, panels = _panels(len(axes), _on_axis(metric), width=3.3, height=3.1)
    for panel, name in zip(panels, axes, strict=True):
        points = {method: _medians(rows, method, name, metric) for method in methods}
        for (method, (spent, error, low, high)), colour in zip(points.items(), cycle(_COLOURS), strict=False):
            panel.errorbar(
                [spent], [error], yerr=[[error - low], [high - error]], fmt="o", color=colour, capsize=2, label=method
            )
        front = _front([(spent, error) for spent, error, _, _ in points.values() if not math.isnan(spent)])
        panel.plot([x for x, _ in front], [y for _, y in front], "--", color="#999999", linewidth=1, zorder=0)
        panel.set_yscale("log")
        panel.set_xlabel(EFFORT[name])
    _legend(panels)
    return _svg(figure, "effort")


def _medians(rows: Sequence[Row], method: str, spent: str, metric: str) -> tuple[float, float, float, float]:
    mine = [row for row in rows if row["method"] == method]
    low, error, high = np.quantile([max(row[metric], FLOOR) for row in mine], (0.25, 0.5, 0.75))
    # Of a method whose price nobody knows there is no point.
    known = [row[spent] for row in mine if row[spent] is not None]
    return float(np.median(known)) if known else math.nan, float(error), float(low), float(high)


def _front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other beats in both, from cheap to dear."""
    front: list[tuple[float, float]] = []
    for spent, error in sorted(points):
        if not front or error < front[-1][1]:
            front.append((spent, error))
    return front


def round_times(times: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    """Times round by round, s: a panel for each kind of time, a line a method."""
    figure, panels = _panels(len(times), "time / s")
    for panel, (title, by_method) in zip(panels, times.items(), strict=True):
        for (method, seconds), colour in zip(by_method.items(), cycle(_COLOURS), strict=False):
            panel.plot(range(1, len(seconds) + 1), seconds, ".-", color=colour, label=method)
        panel.set_yscale("log")
        panel.set_xlabel("round")
        panel.set_title(title, fontsize=10)
    _legend(panels)
    return _svg(figure, "rounds")


def _on_axis(metric: str) -> str:
    """An error as axes call it."""
    return label_of(metric).replace(", ", " / ")


def _panels(
    count: int, label: str, across: int | None = None, width: float = 4.6, height: float = 3.2
) -> tuple[Any, list[Any]]:
    """A figure and its panels with one scale, whose label stands at the first of each row; one row by default."""
    # Figures are made without pyplot, which would keep them and look for a display.
    from matplotlib.figure import Figure

    across = across or count
    down = -(-count // across)
    figure = Figure(figsize=(width * across + 0.6, height * down), layout="constrained")
    panels = list(figure.subplots(down, across, sharey=True, squeeze=False).flat)
    for panel in panels[count:]:
        panel.set_axis_off()
    for panel in panels[:count]:
        panel.grid(axis="y", alpha=0.3)
        panel.spines[["top", "right"]].set_visible(False)
    for panel in panels[:count:across]:
        panel.set_ylabel(label)
    return figure, panels[:count]


def _legend(panels: Sequence[Any]) -> None:
    """Every method once, in the last panel, whichever panels it is in."""
    shown = {label: line for panel in panels for line, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    if shown:
        panels[-1].legend(shown.values(), shown.keys(), fontsize=8, frameon=False)


def _svg(figure: Any, name: str) -> str:
    """The figure as an SVG element that can stand in a page beside others: own identifiers, text as text."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    empty: Mapping[str, Any] = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.size": 9}):
        FigureCanvasSVG(figure)
        figure.savefig(buffer, format="svg", metadata=empty, transparent=True)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    return re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", text)
