"""A hash of sources: what other code made must not be found again, and a version does not change with every edit."""

import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

_ROOT = Path(__file__).parents[1]
_SOURCES = frozenset({".py", ".yaml", ".yml", ".json", ".toml"})
"""Suffixes of the files that determine what code does: the code, and the tables that it reads."""


@cache
def package_digest(*patterns: str) -> str:
    """A hash of this package's sources in the folders and modules that fit: ``core``, ``experiments/*.py``."""
    return source_digest(place for pattern in patterns for place in sorted(_ROOT.glob(pattern)))


def source_digest(places: Iterable[Path]) -> str:
    """A hash of the source files at these places, by their names below them; empty where there is none."""
    found = [
        path.relative_to(place.parent).as_posix().encode() + b"\0" + path.read_bytes() + b"\0"
        for place in places
        for path in (sorted(place.rglob("*")) if place.is_dir() else [place])
        if path.suffix in _SOURCES and path.is_file()
    ]
    return hashlib.sha256(b"".join(found)).hexdigest()[:16] if found else ""
