"""Templates of pages: what they print is escaped, and free of control codes."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from ...core.printable import counted, strip_control
from .wording import change, duration, number, share, unit

if TYPE_CHECKING:
    import jinja2

_OWN = Path(__file__).parent


@cache
def template(name: str, folder: Path = _OWN) -> jinja2.Template:
    """A template of a folder, which may use those of the reports."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, _OWN]),
        autoescape=True,
        finalize=_printable,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(counted=counted, number=number, duration=duration, unit=unit, share=share)
    environment.filters["link"] = lambda path: Path(path).absolute().as_uri()
    environment.globals.update(zip=zip, change=change)
    return environment.get_template(name)


def _printable(value: Any) -> Any:
    """Every expression of a template passes here: nothing may disguise text or steer a reader's tools."""
    return strip_control(value) if isinstance(value, str) and not isinstance(value, Markup) else value
