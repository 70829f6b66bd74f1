"""``report.html`` of a discovery over a life: verdict, mechanisms, and what the cell lost by its own curves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...core.discovery.life_discovery import LifeDiscovery
from .base_parameters import base_parameters
from .chart import Chart, Key, horizontal, padded
from .discovery_lines import untried_line
from .templates import template

_STYLES = ("best", "initial", "limit")
_LOST_HEIGHT, _OTHER_HEIGHT = 210.0, 110.0


def render(discovery: LifeDiscovery) -> str:
    """The page as HTML."""
    content, base = discovery.to_json(), base_parameters(discovery)
    page = template("life_discovery.html.j2")
    return page.render(d=content, chart=_modes(content["modes"]), base=base, untried=untried_line(discovery))


def _modes(modes: Sequence[Mapping[str, Any]]) -> Chart | None:
    """Losses above resistance, by cycle; None where no window could be fitted."""
    lost = [mode for mode in modes if mode["name"].endswith("[%]") and mode["cycles"]]
    others = [mode for mode in modes if not mode["name"].endswith("[%]") and mode["cycles"]]
    if not lost:
        return None
    chart = Chart(
        "modes",
        "Losses and resistance by cycle",
        horizontal(0.0, float(max(mode["cycles"][-1] for mode in lost))),
        "Cycle",
        "Lithium and active material lost, fitted to single cycles.",
        [Key(style, mode["name"]) for style, mode in zip(_STYLES, lost, strict=False)],
    )
    _draw(chart, "Lost / %", lost, _LOST_HEIGHT)
    for mode in others:
        _draw(chart, mode["name"], [mode], _OTHER_HEIGHT)
    return chart


def _draw(chart: Chart, label: str, modes: Sequence[Mapping[str, Any]], height: float) -> None:
    values = np.concatenate([mode["values"] for mode in modes])
    panel = chart.panel(label, padded(float(min(values.min(), 0.0)), float(values.max())), height)
    for style, mode in zip(_STYLES, modes, strict=False):
        panel.draw(np.array(mode["cycles"], dtype=np.float64), np.array(mode["values"]), style)
