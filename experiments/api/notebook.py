"""Results as a notebook shows them: HTML without scripts, which takes no style from the page and gives it none."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..report.templates import template
from ..run_record import RunRecord

if TYPE_CHECKING:
    from ..report.chart import Chart

_HERE = Path(__file__).parent
_CHART = re.compile(r'<svg class="chart" .*?</svg>', re.DOTALL)  # not the small ones of a legend


def render(name: str, **content: Any) -> str:
    """A template of this folder; names of records and parameters are untrusted, and are escaped."""
    return template(name, _HERE).render(**content)


def picture_of(run: RunRecord) -> str:
    """The first record's curves, as the report draws them."""
    from ..report.figures import overlays

    return as_picture(overlays(run)[0].chart)


def as_picture(chart: Chart) -> str:
    """A chart as the address of an image, as the report draws it."""
    return _as_image(render("picture.svg.j2", chart=chart))


def pictures_of(page: Path, most: int) -> list[str]:
    """The first charts of a page, as addresses of images; none where there is no page."""
    return (
        [_as_image(chart) for chart in _CHART.findall(page.read_text(encoding="utf-8"))[:most]] if page.exists() else []
    )


def _as_image(svg: str) -> str:
    """A chart as the address of an image: its styles stay its own."""
    style = (_HERE / "picture.css").read_text(encoding="utf-8")
    alone = svg.strip().replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    alone = alone.replace("<title", f"<style>{style}</style><title", 1)
    return "data:image/svg+xml;base64," + base64.b64encode(alone.encode()).decode("ascii")
