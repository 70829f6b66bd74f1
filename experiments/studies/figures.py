"""Box plots of errors by method, convergence, and time by round."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import replacing
from .cell import CellRecord

_FLOOR = 1e-4
"""Smallest error drawn on the logarithmic axis."""


def box_plots(
    records: Sequence[CellRecord],
    group: Callable[[CellRecord], str],
    path: Path,
    title: str,
    value: Callable[[CellRecord], float] = lambda record: record.metric("mape"),
    label: str = "total MAPE / %",
) -> None:
    """One panel a group, one box a method, a dot a case; logarithmic axis.

    Parameters
    ----------
    records : sequence of CellRecord
        The cells.
    group : callable
        Which panel a record belongs to.
    path : Path
        The PNG file to write.
    title, label : str
        What stands over the figure and beside its axis.
    value : callable
        What is drawn.
    """
    groups = sorted({group(record) for record in records})
    methods = list(dict.fromkeys(record.method for record in records))
    figure, panels = _panels(len(groups), len(methods))
    for panel, name in zip(panels, groups, strict=True):
        columns = [
            [
                max(value(record), _FLOOR)
                for record in records
                if group(record) == name and record.method == method and not math.isnan(value(record))
            ]
            for method in methods
        ]
        places = list(range(1, len(methods) + 1))
        panel.boxplot(columns, positions=places, showfliers=False, widths=0.6)
        for place, column in zip(places, columns, strict=True):
            panel.plot([place] * len(column), column, ".", markersize=4, alpha=0.5, color="C0")
        panel.set_xticks(places, methods, rotation=60, ha="right")
        panel.set_yscale("log")
        panel.set_title(name)
        panel.grid(axis="y", alpha=0.3)
    panels[0].set_ylabel(label)
    _save(figure, path, title)


def convergence(records: Sequence[CellRecord], path: Path) -> None:
    """Best error so far against simulations: median and quartiles over the cases, a panel a mode, a line a method."""
    modes = sorted({record.mode for record in records})
    figure, panels = _panels(len(modes), 10)
    for panel, mode in zip(panels, modes, strict=True):
        for place, method in enumerate(dict.fromkeys(record.method for record in records)):
            own = [r for r in records if (r.mode, r.method) == (mode, method) and r.trials]
            longest = max((len(record.trials) for record in own), default=0)
            if not longest:
                continue
            counts = np.arange(1, longest + 1)
            curves = np.array([[record.best_mape_after(int(n)) for n in counts] for record in own])
            low, middle, high = np.maximum(np.nanpercentile(curves, (25, 50, 75), axis=0), _FLOOR)
            panel.plot(counts, middle, color=f"C{place % 10}", label=method)
            panel.fill_between(counts, low, high, color=f"C{place % 10}", alpha=0.15, linewidth=0)
        panel.set_yscale("log")
        panel.set_title(mode)
        panel.set_xlabel("simulations")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("best total MAPE / %")
    panels[0].legend(fontsize=8)
    _save(figure, path, "Convergence: median and quartiles")


def round_times(records: Sequence[CellRecord], path: Path) -> None:
    """Wall time and proposer time of each round, a line a method."""
    figure, panels = _panels(2, 8)
    for record in records:
        rounds = range(1, len(record.rounds) + 1)
        panels[0].plot(rounds, [entry.round_s for entry in record.rounds], ".-", label=record.method)
        panels[1].plot(rounds, [entry.proposer_s for entry in record.rounds], ".-", label=record.method)
    for panel, title in zip(panels, ("whole round", "proposer, model included"), strict=True):
        panel.set_title(title)
        panel.set_xlabel("round")
        panel.set_yscale("log")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("time / s")
    panels[0].legend(fontsize=8)
    _save(figure, path, "Time by round")


def _panels(count: int, methods: int) -> tuple[Any, list[Any]]:
    # Figures are made without pyplot, which would keep them and look for a display.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(3.0, 0.45 * methods) * count, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, count, sharey=True, squeeze=False)
    return figure, list(panels[0])


def _save(figure: Any, path: Path, title: str) -> None:
    figure.suptitle(title)
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=130)
