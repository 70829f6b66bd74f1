"""Results as a notebook shows them: HTML without scripts, which takes no style from the page and gives it none."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..report.templates import template
from ..run_record import RunRecord

if TYPE_CHECKING:
    from ..report.chart import Chart

_HERE = Path(__file__).parent


def render(name: str, **content: Any) -> str:
    """A template of this folder; names of records and parameters are untrusted, and are escaped."""
    return template(name, _HERE).render(**content)


def picture_of(run: RunRecord) -> str:
    """The first record's curves, as the report draws them."""
    from ..report.figures import overlays

    return as_picture(overlays(run)[0].chart)


def as_picture(chart: Chart) -> str:
    """A chart as the address of an image, as the report draws it."""
    drawing = render("picture.svg.j2", chart=chart)
    style = (_HERE / "picture.css").read_text(encoding="utf-8")
    return as_image(drawing.replace("<title", f"<style>{style}</style><title", 1))


def as_image(svg: str) -> str:
    """An SVG drawing as the address of an image: its styles stay its own."""
    alone = svg.strip().replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    return "data:image/svg+xml;base64," + base64.b64encode(alone.encode()).decode("ascii")
