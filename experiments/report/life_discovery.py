"""``report.html`` of a discovery over a life: verdict, mechanisms, and what the cell lost by its own curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .chart import BOTTOM, GAP, TOP, Axis, Chart, Key, Panel, horizontal, padded, vertical
from .discovery import VERDICTS
from .templates import template

_STYLES = ("best", "initial", "limit")
_LOST_HEIGHT, _OTHER_HEIGHT = 210.0, 110.0


def render(content: Mapping[str, Any]) -> str:
    """The page as HTML.

    Parameters
    ----------
    content : mapping
        What ``discovery.json`` holds.
    """
    chart = _modes(content["modes"])
    return template("life_discovery.html.j2").render(d=content, headline=VERDICTS[content["verdict"]], chart=chart)


def _modes(modes: Sequence[Mapping[str, Any]]) -> Chart | None:
    """Losses above resistance, by cycle; None where no window could be fitted."""
    lost = [mode for mode in modes if mode["name"].endswith("[%]") and mode["cycles"]]
    others = [mode for mode in modes if not mode["name"].endswith("[%]") and mode["cycles"]]
    if not lost:
        return None
    across = horizontal(0.0, float(max(mode["cycles"][-1] for mode in lost)))
    panels = [_panel("Lost / %", lost, across, TOP, _LOST_HEIGHT)]
    for mode in others:
        below = panels[-1]
        panels.append(_panel(mode["name"], [mode], across, below.top + below.height + GAP, _OTHER_HEIGHT))
    return Chart(
        name="modes",
        title="Losses and resistance by cycle",
        description="Lithium and active material lost, fitted to single cycles.",
        panels=panels,
        x_ticks=across.ticks(8),
        x_label="Cycle",
        keys=[Key(style, mode["name"]) for style, mode in zip(_STYLES, lost, strict=False)],
        height=panels[-1].top + panels[-1].height + BOTTOM,
    )


def _panel(label: str, modes: Sequence[Mapping[str, Any]], across: Axis, top: float, height: float) -> Panel:
    values = np.concatenate([mode["values"] for mode in modes])
    axis = vertical(*padded(float(min(values.min(), 0.0)), float(values.max())), top, height)
    panel = Panel(axis, label, ticks=axis.ticks(4))
    for style, mode in zip(_STYLES, modes, strict=False):
        panel.draw(across, np.array(mode["cycles"], dtype=np.float64), np.array(mode["values"]), style)
    return panel
