"""Arbin workbooks: one or more ``Channel_...`` sheets, also a folder of workbooks of one cell."""

from __future__ import annotations

import warnings
import zipfile
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import BsaError, did_you_mean
from ...core.printable import listed, shown
from ...core.reading.clock import RESTART_S
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .columns import Column, resolve, signal_of
from .source import MAX_SAMPLES

SUFFIXES = (".xlsx", ".xlsm", ".xls")

MAX_UNPACKED_BYTES = 2 * 2**30
"""Largest workbook that is read, unpacked."""

MAX_RATIO = 300
"""A part of a workbook that grows by more than this when unpacked is refused (from `RATIO_BYTES` on)."""

RATIO_BYTES = 64 * 2**20

_HEADER_ROWS = 20


@dataclass
class _Sheet:
    """The samples of one sheet, as numbers in the file's units."""

    name: str
    columns: dict[str, Column]
    rows: array[int] = field(default_factory=lambda: array("q"))
    values: dict[str, array[float]] = field(default_factory=dict)
    dates: array[float] = field(default_factory=lambda: array("d"))


class ArbinXlsx:
    """Reads Arbin workbooks: ``Test_Time(s)``, ``Current(A)`` (positive on charge), ``Voltage(V)``.

    A clock that restarts between or inside sheets is carried on with the help of ``Date_Time``. Formulas are
    never evaluated: their stored values are read.
    """

    def matches(self, path: Path) -> bool:
        """Whether it is a workbook, or a folder of nothing but workbooks."""
        if path.is_dir():
            files = [child for child in path.iterdir() if not child.name.startswith(".")]
            return bool(files) and all(child.suffix.lower() in SUFFIXES for child in files)
        return path.suffix.lower() in SUFFIXES and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the workbook, or all workbooks of the folder; see `Reader.read`."""
        books = [path]
        if path.is_dir():
            books = sorted(child for child in path.iterdir() if not child.name.startswith("."))
        sheets = [sheet for book in books for sheet in _sheets(book, options, len(books) > 1)]
        # File names carry the date as month_day_year, which does not sort; the samples' own dates do.
        sheets.sort(key=lambda sheet: next((date for date in sheet.dates if date == date), np.inf))
        return _joined(sheets, path.name, len(books), options)


def _sheets(path: Path, options: ReadOptions, several: bool) -> list[_Sheet]:
    name = shown(path.name)
    _refuse_bomb(path, name)
    import openpyxl

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
            try:
                return _tables(book, name, options, several)
            finally:
                book.close()
    except (BsaError, MemoryError):
        raise
    except Exception as error:  # whatever a damaged workbook provokes in openpyxl
        raise BsaError(
            f"{name} is a damaged workbook ({type(error).__name__}: {shown(error)}).",
            "open it in a spreadsheet and save it again, or export CSV.",
        ) from None


def _refuse_bomb(path: Path, name: str) -> None:
    """Look at the sizes that the parts declare, which is all that is unpacked of them."""
    try:
        with zipfile.ZipFile(path) as package:
            parts = package.infolist()
    except OSError as error:
        raise BsaError(f"{name} cannot be read: {shown(error.strerror)}.", "check the path and its rights.") from None
    except (zipfile.BadZipFile, ValueError, NotImplementedError):
        raise BsaError(
            f"{name} is not an Excel workbook of today's kind (.xlsx).",
            "open it in a spreadsheet and save it as .xlsx, or give a CSV file its own name.",
        ) from None
    unpacked = sum(part.file_size for part in parts)
    if unpacked > MAX_UNPACKED_BYTES:
        raise BsaError(
            f"{name} unpacks to {unpacked / 2**30:.1f} GiB, more than the limit of {MAX_UNPACKED_BYTES // 2**30} GiB.",
            "export the record as CSV.",
        )
    for part in parts:
        if part.file_size > RATIO_BYTES and part.file_size > MAX_RATIO * max(part.compress_size, 1):
            raise BsaError(
                f'{name}: the part "{shown(part.filename)}" unpacks to {part.file_size // max(part.compress_size, 1)} '
                f"times its size; the limit is {MAX_RATIO}.",
                "export the record as CSV.",
            )


def _tables(book: Any, name: str, options: ReadOptions, several: bool) -> list[_Sheet]:
    titles = [sheet.title for sheet in book.worksheets]
    if options.sheet is not None and options.sheet not in titles:
        nearest = did_you_mean(options.sheet, titles)
        raise BsaError(
            f'{name} has no sheet "{shown(options.sheet)}".',
            f"{nearest} " * bool(nearest) + f"Sheets: {listed(titles)}.",
        )
    found: list[_Sheet] = []
    seen: list[str] = []
    for sheet in book.worksheets:
        if options.sheet not in (None, sheet.title):
            continue
        sheet.reset_dimensions()
        rows = ((number, values) for number, values in enumerate(sheet.iter_rows(values_only=True), 1))
        header = _header(rows, options, chosen=options.sheet is not None)
        if header is None:
            seen.append(sheet.title)
            continue
        label = shown(f"{name}: {sheet.title}" if several else sheet.title)
        found.append(_table(rows, header, label, name, options))
    if not found:
        raise BsaError(
            f"{name} has no sheet with columns for time, voltage and current (sheets: {listed(seen)}).",
            "Arbin names them Test_Time(s), Voltage(V), Current(A); say others with --sheet and --column time=NAME.",
        )
    return found


Rows = Iterator[tuple[int, tuple[Any, ...]]]


def _header(rows: Rows, options: ReadOptions, chosen: bool) -> list[str] | None:
    for number, values in rows:
        names = ["" if value is None else str(value).strip() for value in values]
        signals = {signal_of(name) for name in names if name}
        said = options.columns.values()
        if {"time", "voltage"} <= signals or (said and all(wanted in names for wanted in said)):
            return names
        if chosen and sum(bool(name) for name in names) >= 3:
            # The user says that this is the sheet: `resolve` then lists the columns it has.
            return names
        if number >= _HEADER_ROWS:
            break
    return None


def _table(rows: Rows, header: list[str], label: str, name: str, options: ReadOptions) -> _Sheet:
    columns: dict[str, Column] = {str(key): value for key, value in resolve(header, None, options, name).items()}
    sheet = _Sheet(label, columns, values={signal: array("d") for signal in columns})
    date_place = next((k for k, text in enumerate(header) if text.casefold() in ("date_time", "datetime")), None)
    conditions = [(_place(header, key, name), wanted) for key, wanted in options.where.items()]
    for number, values in rows:
        if all(value is None for value in values):
            continue
        if any(str(_cell(values, place)) != wanted for place, wanted in conditions):
            continue
        sheet.rows.append(number)
        for signal, column in columns.items():
            sheet.values[signal].append(_number(_cell(values, column.index), name, label, number, column.name))
        date = _cell(values, date_place) if date_place is not None else None
        sheet.dates.append(_seconds(date))
        if len(sheet.rows) > MAX_SAMPLES:
            raise BsaError(f"{name} has more than {MAX_SAMPLES} rows.", "cut it, or export CSV and thin it out.")
    return sheet


def _place(header: list[str], key: str, name: str) -> int:
    if key not in header:
        raise BsaError(f'"{shown(key)}" is not a column of {name}.', f"Columns: {listed(header)}.")
    return header.index(key)


def _cell(values: tuple[Any, ...], place: int) -> Any:
    return values[place] if place < len(values) else None


def _number(value: Any, name: str, label: str, row: int, column: str) -> float:
    if value is None:
        return float("nan")
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    try:
        return float(str(value))
    except ValueError:
        raise BsaError(
            f'{name}: sheet {label}, row {row}, column "{shown(column)}": "{shown(value)}" is not a number.',
            "repair or remove the row.",
        ) from None


def _seconds(date: Any) -> float:
    if isinstance(date, datetime):
        return (date - datetime(1970, 1, 1)).total_seconds()
    if isinstance(date, int | float) and not isinstance(date, bool):
        return float(date) * 86400.0
    return float("nan")


def _joined(sheets: list[_Sheet], source: str, books: int, options: ReadOptions) -> Samples:
    lengths = [len(sheet.rows) for sheet in sheets]
    signals = [s for s in ("time", "voltage", "current", "temperature") if all(s in sheet.columns for sheet in sheets)]
    joined: dict[str, FloatArray] = {
        signal: np.concatenate([sheet.columns[signal].in_si(np.array(sheet.values[signal])) for sheet in sheets])
        for signal in signals
    }
    notes = []
    if "current" not in joined:
        joined["current"] = np.full(sum(lengths), float(options.constant_current_a or 0.0))
        notes.append(f"no current column; {options.constant_current_a:g} A was used throughout, as said.")
    if len(sheets) > 1:
        notes.append(f"{len(sheets)} sheets of {books} workbooks were joined: {listed(s.name for s in sheets)}.")
    samples = Samples(
        source=source,
        rows=np.concatenate([np.array(sheet.rows, dtype=np.int64) for sheet in sheets]),
        time=joined["time"],
        voltage=joined["voltage"],
        current=joined["current"],
        temperature=joined.get("temperature"),
        names={column.signal: shown(column.name) for column in sheets[0].columns.values()},
        notes=tuple(notes),
        sheets=tuple(sheet.name for sheet in sheets),
        sheet=np.repeat(np.arange(len(sheets)), lengths).astype(np.int64),
    )
    return _carried_on(samples, np.concatenate([np.array(sheet.dates) for sheet in sheets]))


def _carried_on(samples: Samples, dates: NDArray[np.float64]) -> Samples:
    """Let the clock run on where it restarts, by the date of the rows, or by one interval where they have none."""
    time = samples.time.copy()
    restarts = np.flatnonzero(np.diff(time) < -RESTART_S) + 1
    notes: list[str] = []
    for k in restarts.tolist():
        passed = dates[k] - dates[k - 1]
        known = bool(np.isfinite(passed) and passed >= 0)
        spacing = float(np.median(np.abs(np.diff(samples.time[max(0, k - 50) : k])))) if k > 1 else 0.0
        time[k:] += time[k - 1] + (passed if known else spacing) - time[k]
        how = f"{passed:g} s later by its date" if known else "at once, for want of a date"
        notes.append(f"the clock restarts in {samples.place(k)}; it was carried on {how}.")
    if len(notes) > 5:
        notes = [*notes[:5], f"{len(notes) - 5} more restarts of the clock were carried on in the same way."]
    return Samples(**{**samples.__dict__, "time": time, "notes": (*samples.notes, *notes)})
