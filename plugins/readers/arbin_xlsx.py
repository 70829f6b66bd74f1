"""Arbin workbooks: one or more ``Channel_...`` sheets."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import BsaError, did_you_mean
from ...core.printable import listed, shown
from ...core.reading.joining import joined
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from .assembly import read_table
from .columns import signal_of
from .source import decoding, refuse_zip_bomb
from .table import Table

SUFFIXES = (".xlsx", ".xlsm", ".xls")

MAX_UNPACKED_BYTES = 2 * 2**30
"""Largest workbook that is read, unpacked."""

_HEADER_ROWS = 20


class ArbinXlsx:
    """Reads workbooks: ``Test_Time(s)``, ``Current(A)`` (positive on charge), ``Voltage(V)``; sheets are joined.

    Formulas are never evaluated: their stored values are read.
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
            return joined(parts, path.name)
        return replace(
            parts[0], source=path.name, sheets=(parts[0].source,), sheet=np.zeros(len(parts[0]), dtype=np.int64)
        )


def _tables(book: Any, name: str, options: ReadOptions) -> list[Table]:
    """The sheets with columns for a time and a voltage."""
    titles = [sheet.name for sheet in book.sheets_metadata if "WorkSheet" in str(sheet.typ)]
    if options.sheet is not None and options.sheet not in titles:
        nearest = did_you_mean(options.sheet, titles)
        raise BsaError(
            f'{name} has no sheet "{shown(options.sheet)}".',
            f"{nearest} " * bool(nearest) + f"Sheets: {listed(titles)}.",
        )
    found: list[Table] = []
    for title in titles if options.sheet is None else [options.sheet]:
        sheet = book.get_sheet_by_name(title)
        rows = ((number, [_text(value) for value in values]) for number, values in enumerate(_rows(sheet), 1))
        header = _header(rows, options)
        if header is not None:
            number, names = header
            found.append(Table(name, names, None, partial(_cells, sheet, number), ",", place=f"sheet {shown(title)}, "))
    if not found:
        raise BsaError(
            f"{name} has no sheet with columns for time, voltage and current (sheets: {listed(titles)}).",
            "Arbin names them Test_Time(s), Voltage(V), Current(A); say others with --sheet and --column time=NAME.",
        )
    return found


def _rows(sheet: Any) -> Iterator[list[Any]]:
    """All rows; the first ones, which calamine leaves out where they are empty, are counted."""
    yield from ([] for _ in range(sheet.start[0] if sheet.start else 0))
    yield from sheet.iter_rows()


def _text(value: Any) -> str:
    return str(value).strip()


def _header(rows: Iterator[tuple[int, list[str]]], options: ReadOptions) -> tuple[int, tuple[str, ...]] | None:
    """The row of names near the top, and its number."""
    said = options.columns.values()
    for number, names in rows:
        signals = {signal_of(name) for name in names if name}
        if {"time", "voltage"} <= signals or (said and all(wanted in names for wanted in said)):
            return number, tuple(names)
        if options.sheet is not None and sum(bool(name) for name in names) >= 3:
            # The user says that this is the sheet: `resolve` then lists the columns it has.
            return number, tuple(names)
        if number >= _HEADER_ROWS:
            break
    return None


def _cells(sheet: Any, header: int) -> Iterator[tuple[int, list[str]]]:
    """The rows below the header that are not blank."""
    for number, values in enumerate(_rows(sheet), 1):
        cells = [_text(value) for value in values] if number > header else []
        if any(cells):
            yield number, cells
