"""Finds the reader that a file needs, and makes a record of what it reads."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..contracts.border import Unfit, border
from ..contracts.products import instance
from ..contracts.registry import Registry, installed
from ..errors import BsaError
from ..printable import shown
from ..record import Reader, ReadOptions, Record
from ..spectrum import ImpedanceSpectrum
from .checks import to_record
from .joining import joined
from .part_of_file import file_and_part
from .samples import Samples

PICKLES = (".pkl", ".pickle")

_HIDDEN = (".", "~$")
"""How the names of files begin that a folder has beside its records; Excel writes the second while a file is open."""

FALLBACK = "generic-csv"
"""Asked last, since it takes any text table."""


def read_file(
    path: Path | str | Sequence[Path | str],
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
    reader_options: Mapping[str, Any] | None = None,
) -> Record | ImpedanceSpectrum:
    """Read a file of a laboratory, whatever it holds, or several files of one cell as one record.

    Parameters
    ----------
    path : Path or str, or sequence of them
        The file, the files of one cell, or a folder of nothing else. Files are joined in the order of their dates.
        ``rates.mat#T25/cRate_1C`` is a test, or sheet, of a file that holds several.
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
    registry = registry or installed()
    options = options or ReadOptions()
    files = _files(path, registry)
    read = [_read(file, options, registry, reader, reader_options or {}) for file in files]
    if len(read) == 1 and isinstance(read[0], ImpedanceSpectrum):
        return read[0]
    parts = [part for part in read if isinstance(part, Samples)]
    if len(parts) < len(read):
        raise BsaError(
            f"{len(read) - len(parts)} of {len(read)} files to be joined are impedance spectra.",
            "give them by themselves.",
        )
    several = f"{parts[0].source} and {len(parts) - 1} more"
    return to_record(joined(parts, Path(path).resolve().name if isinstance(path, (str, Path)) else several), options)


def _files(path: Path | str | Sequence[Path | str], registry: Registry) -> list[Path]:
    """The files that are meant; those of a folder, unless a reader takes the folder itself."""
    given = [Path(one) for one in ([path] if isinstance(path, (str, Path)) else path)]
    if not given:
        raise BsaError("no file is given.", "give one at least.")
    for one in given:
        file, _ = file_and_part(one)
        if "\0" in str(file) or not file.exists():
            raise BsaError(f"there is no file {shown(file, 200)}.", "check the path.")
    if len(given) > 1 or not given[0].is_dir() or _matching(given[0], registry, []):
        return given
    files = sorted(child for child in given[0].iterdir() if not child.name.startswith(_HIDDEN) and child.is_file())
    return files or given


def _read(
    path: Path, options: ReadOptions, registry: Registry, reader: str | None, reader_options: Mapping[str, Any]
) -> Samples | ImpedanceSpectrum:
    notes: list[str] = []
    path, part = file_and_part(path)
    options = options if part is None else options.model_copy(update={"sheet": part})
    name = reader or _recognised(path, registry, notes)
    chosen = _made(registry, name, reader_options)
    with border(registry.find("reader", name).who, "read"):
        read = chosen.read(path, options)
        if not isinstance(read, ImpedanceSpectrum):
            instance(read, Samples)
    return replace(read, notes=(*read.notes, *notes))


def read_record(
    path: Path | str | Sequence[Path | str],
    options: ReadOptions | None = None,
    registry: Registry | None = None,
    reader: str | None = None,
    reader_options: Mapping[str, Any] | None = None,
) -> Record:
    """Read a record over time from one or several files; see `read_file`.

    Raises `BsaError` also if the file holds an impedance spectrum.
    """
    found = read_file(path, options, registry, reader, reader_options)
    if isinstance(found, ImpedanceSpectrum):
        raise BsaError(
            f"{found.name} is an impedance spectrum, not a record over time.",
            "give a record of time, voltage and current; bsa data shows what a spectrum holds.",
        )
    return found


def _made(registry: Registry, name: str, options: Mapping[str, Any]) -> Reader:
    made = registry.make("reader", name, options)
    with border(registry.find("reader", name).who, "its factory"):
        if not isinstance(made, Reader):
            raise Unfit(f"returned {type(made).__name__}, which lacks matches or read")
    return made


def _matching(path: Path, registry: Registry, notes: list[str]) -> list[str]:
    """The readers that take the file; one that fails is not this file's, which is noted."""
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
    return matching


def _recognised(path: Path, registry: Registry, notes: list[str]) -> str:
    """The name of the one reader that takes the file."""
    matching = _matching(path, registry, notes)
    if len(matching) > 1 and FALLBACK in matching:
        matching.remove(FALLBACK)
    if len(matching) > 1:
        names = sorted(matching)
        raise BsaError(
            f"{shown(path.name)} is recognised by {len(names)} readers: {', '.join(names)}.",
            f"choose one: --reader {names[0]}.",
        )
    if path.suffix.lower() in PICKLES:
        raise BsaError(
            f"{shown(path.name)} holds Python objects; it is not opened, since opening one runs whatever is in it.",
            f'where you trust it: pandas.read_pickle("{shown(path.name)}").to_csv("{shown(path.stem)}.csv").',
        )
    if not matching:
        entries = [listing.entry for listing in registry.listings("reader")]
        known = "; ".join(f"{entry.name} ({entry.summary.rstrip('.')})" for entry in entries)
        kind = "folder" if path.is_dir() else "file"
        unasked = f" ({'; '.join(note.rstrip('.') for note in notes)})" if notes else ""
        raise BsaError(
            f"no reader recognises the {kind} {shown(path.name)}{unasked}.",
            f"readers: {known}. Name a text table .csv and say its columns with --column time=NAME.",
        )
    return matching[0]
