"""Arbin workbooks: one or more ``Channel_...`` sheets."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import BsaError, did_you_mean
from ...core.printable import listed, shown
from ...core.reading.joining import joined
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from .assembly import read_table
from .columns import EXTRA, named, signal_of, split_name
from .source import decoding, refuse_zip_bomb
from .table import Table, are_units, have_decimal_commas

SUFFIXES = (".xlsx", ".xlsm", ".xls")

MAX_UNPACKED_BYTES = 2 * 2**30
"""Largest workbook that is read, unpacked."""

_HEADER_ROWS = 20

_CHANNEL = re.compile(r"(?P<name>channel[-_ ]?\d+(?:-\d+)?)(?:_\d+)?", re.IGNORECASE)
"""Title of a sheet of samples: a channel, and a number where one sheet was too short for it."""

_STATISTICS = ("vmaxoncycle", "chargetime")
"""Columns of a sheet with one row for each cycle, folded."""


class ArbinXlsx:
    """Reads workbooks: ``Test_Time(s)``, ``Current(A)`` (positive on charge), ``Voltage(V)``.

    The sheets of a channel are joined. Of a workbook with several channels ``--sheet Channel_1-003`` chooses one;
    statistics (one row for each cycle) are left out. Other sheets are joined if one clock runs through all of them, or
    with ``--join``. Formulas are never evaluated: their stored values are read.
    """

    def matches(self, path: Path) -> bool:
        """Whether the name is that of a workbook."""
        return path.suffix.lower() in SUFFIXES and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the workbook; see `Reader.read`."""
        name = shown(path.name)
        # The kind before 2007 (.xls) is no archive and cannot grow.
        if path.suffix.lower() != ".xls":
            refuse_zip_bomb(path, name, "an Excel workbook of today's kind (.xlsx)", MAX_UNPACKED_BYTES)
        import python_calamine

        with (
            decoding(name, "workbook", "open it in a spreadsheet and save it as .xlsx, or export CSV."),
            python_calamine.CalamineWorkbook.from_path(path) as book,
        ):
            tables = _tables(book, name, options)
            parts = [replace(read_table(table, options), source=table.place[:-2]) for table in tables]
        if len(parts) > 1:
            if not options.join:
                _refuse_several_tests(parts, name)
            return joined(parts, path.name)
        return replace(
            parts[0], source=path.name, sheets=(parts[0].source,), sheet=np.zeros(len(parts[0]), dtype=np.int64)
        )


def _tables(book: Any, name: str, options: ReadOptions) -> list[Table]:
    """The sheets with columns for a time and a voltage, of one channel.

    Raises `BsaError` if there is none, or if they are of several channels that nobody joins.
    """
    titles = [sheet.name for sheet in book.sheets_metadata if "WorkSheet" in str(sheet.typ)]
    found: dict[str, Table] = {}
    for title in titles if options.sheet is None else _meant(options.sheet, titles, name):
        sheet = book.get_sheet_by_name(title)
        header = _header(_cells(sheet, 0), options)
        if header is not None and (options.sheet is not None or not _is_statistics(title, header[1])):
            found[title] = _table(sheet, *header, name, f"sheet {shown(title)}, ")
    if not found:
        raise BsaError(
            f"{name} has no sheet with columns for time, voltage and current (sheets: {listed(titles)}).",
            "Arbin names them Test_Time(s), Voltage(V), Current(A); say others with --sheet and --column time=NAME.",
        )
    if options.sheet is not None:
        return list(found.values())
    found = {title: table for title, table in found.items() if _channel(title)} or found
    channels = list(dict.fromkeys(filter(None, map(_channel, found))))
    if len(channels) > 1 and not options.join:
        raise BsaError(
            f"{name} has {len(channels)} channels, and each is a cell of its own: {listed(channels)}.",
            f'choose one with --sheet "{shown(channels[0])}", or say --join if all are of one cell.',
        )
    return list(found.values())


def _table(sheet: Any, number: int, names: tuple[str, ...], source: str, place: str) -> Table:
    """The rows below the one of names, and the units that may stand between."""
    below, first = next(_cells(sheet, number), (number, []))
    units = tuple(first[: len(names)]) if are_units(first, names) else None
    cells = partial(_cells, sheet, number if units is None else below)
    comma = have_decimal_commas(row for _, row in cells())
    return Table(source, names, units, cells, ",", comma, place)


def _meant(wanted: str, titles: Sequence[str], name: str) -> list[str]:
    """All sheets of the channel, or the sheet of this title. Raises `BsaError` if there is none."""
    found = [title for title in titles if _channel(title) == wanted] or [title for title in titles if title == wanted]
    if not found:
        nearest = did_you_mean(wanted, titles)
        raise BsaError(
            f'{name} has no sheet "{shown(wanted)}".',
            f"{nearest} " * bool(nearest) + f"Sheets: {listed(titles)}.",
        )
    return found


def _refuse_several_tests(parts: Sequence[Samples], name: str) -> None:
    """Raise `BsaError` if sheets that are of no channel begin their clocks anew: they may be of several cells."""
    titles = [part.source.removeprefix("sheet ") for part in parts]
    for (before, after), title in zip(pairwise(parts), titles[1:], strict=True):
        anew = bool(np.nanmin(after.time, initial=np.inf) < np.nanmax(before.time, initial=-np.inf))
        if anew and _channel(title) is None:
            raise BsaError(
                f'{name} has {len(parts)} sheets of samples, and the clock begins anew in "{shown(title)}".',
                f'choose one with --sheet "{shown(titles[0])}", or say --join if all are of one cell.',
            )


def _channel(title: str) -> str | None:
    """The channel that a sheet is of: ``Channel_1-008`` of the sheet ``Channel_1-008_2``."""
    match = _CHANNEL.fullmatch(title)
    return match["name"] if match else None


def _is_statistics(title: str, header: Sequence[str]) -> bool:
    """Whether a sheet has one row for each cycle, of samples that stand in another one."""
    bases = {split_name(name)[0] for name in header}
    return title.casefold().startswith("statistics") or (_channel(title) is None and not bases.isdisjoint(_STATISTICS))


def _header(rows: Iterator[tuple[int, list[str]]], options: ReadOptions) -> tuple[int, tuple[str, ...]] | None:
    """The row of names near the top, and its number."""
    said = options.signal_columns.values()
    for number, names in rows:
        signals = {signal_of(name) for name in names if name}
        timed = "time" in signals or named(names, EXTRA["date"]) is not None
        if (timed and "voltage" in signals) or (said and all(wanted in names for wanted in said)):
            return number, tuple(names)
        if options.sheet is not None and sum(bool(name) for name in names) >= 3:
            # The user says that this is the sheet: `resolve` then lists the columns it has.
            return number, tuple(names)
        if number >= _HEADER_ROWS:
            break
    return None


def _cells(sheet: Any, header: int) -> Iterator[tuple[int, list[str]]]:
    """The rows below one (0 for all) that are not blank."""
    left_out = sheet.start[0] if sheet.start else 0  # empty rows at the top, which calamine does not give
    for number, values in enumerate(sheet.iter_rows(), left_out + 1):
        cells = [str(value).strip() for value in values] if number > header else []
        if any(cells):
            yield number, cells
