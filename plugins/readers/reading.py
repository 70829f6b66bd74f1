"""Finds the reader that a file needs."""

from __future__ import annotations

from pathlib import Path

from ...core.errors import BsaError
from ...core.hooks import Entry
from ...core.printable import shown
from ...core.record import Reader, ReadOptions, Record
from ...core.registry import Registry, installed

FALLBACK = "generic-csv"
"""Asked last, since it takes any text table."""


def read_record(
    path: Path | str,
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
) -> Record:
    """Read a cycler's file.

    Parameters
    ----------
    path : Path or str
        The file (or, for Arbin, a folder of workbooks of one cell).
    options : ReadOptions, optional
        What the header does not say: columns, units, sign of the current, cycles, sheet.
    registry : Registry, optional
        Where readers are looked up; the installed ones by default.
    reader : str, optional
        Name of the reader; by default the one that recognises the file.

    Returns
    -------
    Record
        In SI units, current positive on discharge, cut into steps.

    Raises
    ------
    BsaError
        In one line with a hint, for everything that can be wrong with a file.
    """
    path = Path(path)
    registry = registry or installed()
    options = options or ReadOptions()
    if "\0" in str(path) or not path.exists():
        raise BsaError(f"there is no file {shown(path, 200)}.", "check the path.")
    chosen = _make(registry.get("reader", reader)) if reader else _recognised(path, registry)
    return chosen.read(path, options)


def _make(entry: Entry) -> Reader:
    made: Reader = entry.factory(entry.config_type())
    return made


def _recognised(path: Path, registry: Registry) -> Reader:
    matching: dict[str, Reader] = {}
    for listing in registry.listings("reader"):
        candidate = _make(listing.entry)
        if candidate.matches(path):
            matching[listing.entry.name] = candidate
    if len(matching) > 1:
        matching.pop(FALLBACK, None)
    if len(matching) > 1:
        names = sorted(matching)
        raise BsaError(
            f"{shown(path.name)} is recognised by {len(names)} readers: {', '.join(names)}.",
            f"choose one: --reader {names[0]}.",
        )
    if not matching:
        entries = [listing.entry for listing in registry.listings("reader")]
        known = "; ".join(f"{entry.name} ({entry.summary.rstrip('.')})" for entry in entries)
        kind = "folder" if path.is_dir() else "file"
        raise BsaError(
            f"no reader recognises the {kind} {shown(path.name)}.",
            f"readers: {known}. Name a text table .csv and say its columns with --column time=NAME.",
        )
    return next(iter(matching.values()))
