"""Tells the pages that this package wrote from other people's files."""

from contextlib import suppress
from pathlib import Path

from ..core.files import foreign

_GENERATOR = b'<meta name="generator" content="battery-sim-agent">'
"""Stands in the head of every page."""

_HEAD_BYTES = 2048
"""The head of a page fits in."""


def check_page(path: Path) -> None:
    """Refuse a path at which something else lies than a page of ours.

    Raises `BsaError` if there is a folder, a link or another file.
    """
    if not path.exists() and not path.is_symlink():
        return
    with suppress(OSError), path.open("rb") as file:
        if path.is_file() and _GENERATOR in file.read(_HEAD_BYTES):
            return
    raise foreign(path, "a page of ours")
