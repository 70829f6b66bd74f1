"""Finds the reader that a file needs, and makes a record of what it reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..border import Unfit, border
from ..errors import BsaError
from ..printable import shown
from ..products import instance
from ..record import Reader, ReadOptions, Record
from ..registry import Registry, installed
from ..spectrum import ImpedanceSpectrum
from .checks import to_record
from .samples import Samples

FALLBACK = "generic-csv"
"""Asked last, since it takes any text table."""


def read_file(
    path: Path | str,
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
    reader_options: Mapping[str, Any] | None = None,
) -> Record | ImpedanceSpectrum:
    """Read a file of a laboratory, whatever it holds.

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
    reader_options : mapping, optional
        The reader's own options, checked against its ``config_type``.

    Returns
    -------
    Record or ImpedanceSpectrum
        A record is in SI units, current positive on discharge, cut into steps; checked, whichever reader read it.

    Raises
    ------
    BsaError
        In one line with a hint, for everything that can be wrong with a file or a reader.
    """
    path = Path(path)
    registry = registry or installed()
    options = options or ReadOptions()
    if "\0" in str(path) or not path.exists():
        raise BsaError(f"there is no file {shown(path, 200)}.", "check the path.")
    notes: list[str] = []
    name = reader or _recognised(path, registry, notes)
    chosen = _made(registry, name, reader_options or {})
    with border(registry.find("reader", name).who, "read"):
        read = chosen.read(path, options)
        if isinstance(read, ImpedanceSpectrum):
            return replace(read, notes=(*read.notes, *notes))
        samples = instance(read, Samples)
    for note in notes:
        samples = samples.noted(note)
    return to_record(samples, options)


def read_record(
    path: Path | str,
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
    reader_options: Mapping[str, Any] | None = None,
) -> Record:
    """Read a cycler's file; see `read_file`.

    Raises
    ------
    BsaError
        Also if the file holds an impedance spectrum.
    """
    found = read_file(path, options, registry, reader, reader_options)
    if isinstance(found, ImpedanceSpectrum):
        raise BsaError(
            f"{found.name} is an impedance spectrum, not a record over time.",
            "give a record of time, voltage and current; bsa data shows what a spectrum holds.",
        )
    return found


def read_spectrum(
    path: Path | str,
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
    reader_options: Mapping[str, Any] | None = None,
) -> ImpedanceSpectrum:
    """Read an impedance spectrum; see `read_file`.

    Raises
    ------
    BsaError
        Also if the file holds a record over time.
    """
    found = read_file(path, options, registry, reader, reader_options)
    if isinstance(found, Record):
        raise BsaError(
            f"{found.name} is a record over time, not an impedance spectrum.",
            "give a table of frequency, real and imaginary impedance.",
        )
    return found


def _made(registry: Registry, name: str, options: Mapping[str, Any]) -> Reader:
    made = registry.make("reader", name, options)
    with border(registry.find("reader", name).who, "its factory"):
        if not isinstance(made, Reader):
            raise Unfit(f"returned {type(made).__name__}, which lacks matches or read")
    return made


def _recognised(path: Path, registry: Registry, notes: list[str]) -> str:
    """The name of the reader that takes the file; one that fails is not this file's, which is noted."""
    matching: list[str] = []
    for listing in registry.listings("reader"):
        name = listing.entry.name
        try:
            candidate = _made(registry, name, {})
            with border(listing.who, "matches"):
                if instance(candidate.matches(path), bool):
                    matching.append(name)
        except BsaError as error:
            notes.append(f"not asked whether it knows the file: {error.message}")
    if len(matching) > 1 and FALLBACK in matching:
        matching.remove(FALLBACK)
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
    return matching[0]
