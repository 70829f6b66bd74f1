"""A table of numbers somewhere in a text: its header, its separator and its rows."""

import csv
import re
import unicodedata
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from ...core.errors import BsaError, did_you_mean
from ...core.printable import listed, shown
from ...core.trajectory import FloatArray
from .source import MAX_SAMPLES

_PREAMBLE_LINES = 200

_SAYS_ITS_LENGTH = re.compile(r"Nb header lines\s*:\s*(\d{1,7})", re.IGNORECASE)
"""How EC-Lab's text files say how many lines their header has: one for each loop, and so hundreds."""

FIRST_ROWS = 50
"""Rows that are looked at for how a column is written: the first may be empty, or a whole number without a comma."""

_SEPARATORS: tuple[str | None, ...] = (";", "\t", ",", None)
_COMMENTS = frozenset({"#", "%", "//"})
_MISSING = frozenset({"", "nan", "nat", "na", "<na>", "n/a", "#n/a", "null", "none", "-", "--"})

_UNITS = frozenset(
    [
        *("s", "sec", "ms", "min", "h", "v", "mv", "v vs. ref.", "a", "ma", "ua", "μa", "ah", "mah", "c", "w", "mw"),
        *("wh", "mwh", "°c", "degc", "deg c", "k", "°f", "degf", "ohm", "mohm", "ω", "mω", "hz", "khz", "mhz", "%"),
        *("#", "bits"),
    ]
)
"""What a row of units holds that has no brackets, folded. Other words may be names."""


@dataclass
class Numbers:
    """The wanted columns."""

    rows: NDArray[np.int64]  # Line numbers in the file. Shape (n,).
    values: dict[int, FloatArray]  # Numbers by the place of their column; NaN where a cell is empty. Shape (n,).
    texts: dict[int, list[str]] = field(default_factory=dict)  # Columns that hold no numbers, such as dates.
    notes: list[str] = field(default_factory=list)  # What was left out.


@dataclass(frozen=True)
class Table:
    """Where the numbers of a text file are."""

    source: str  # Printable name of the file.
    header: tuple[str, ...]  # Names of the columns; ``"1"``, ``"2"``, ... where the file names none.
    units: tuple[str, ...] | None  # Row of units beneath the header.
    # Gives the number, from 1, and the cells of each row that is not blank.
    cells: Callable[[], Iterator[tuple[int, list[str]]]]
    separator: str | None  # What parts the cells; None for white space.
    decimal_comma: bool = False  # Whether the numbers are written like ``3,7``.
    place: str = ""  # Where the table stands in its file, for messages: ``"sheet Channel_1-008, "``.
    notes: tuple[str, ...] = ()  # What was done to make one table of the file.

    def first(self, place: int) -> str:
        """The first cell of a column that holds something, among the first rows; empty where none does."""
        return first_filled(row[place] for _, row in islice(self.cells(), FIRST_ROWS) if place < len(row))

    def numbers(self, wanted: Sequence[int], where: Mapping[str, str], texts: Sequence[int] = ()) -> Numbers:
        """Read columns.

        ``wanted`` are places of columns of numbers, ``where`` columns and the values that a row must have to be kept,
        ``texts`` places of columns that are wanted as they are written; an absent cell is empty. Raises `BsaError`
        naming the row, the column and the value of a cell that is no number.
        """
        conditions = row_conditions(self.header, where, self.source)
        width = len(self.header)
        needed = max([*wanted, *(place for place, _ in conditions)], default=0) + 1
        rows, columns = array("q"), {place: array("d") for place in wanted}
        written: dict[int, list[str]] = {place: [] for place in texts}
        short: int | None = None
        for number, cells in self.cells():
            if short is not None:
                _refuse_width(self, short, "fewer")
            if len(cells) < needed:
                # Only the last row may be torn: the cycler or the copy was stopped while it was written.
                short = number
                continue
            if len(cells) > width and any(cell.strip() for cell in cells[width:]):
                _refuse_width(self, number, "more")
            if any(not same(cells[place], value) for place, value in conditions):
                continue
            rows.append(number)
            for place, kept in written.items():
                kept.append(cells[place] if place < len(cells) else "")
            for place, column in columns.items():
                value = number_in(cells[place], self.decimal_comma)
                if value is None:
                    raise self._text(place, number, conditions)
                column.append(value)
            if len(rows) > MAX_SAMPLES:
                raise BsaError(f"{self.source} has more than {MAX_SAMPLES} rows.", "cut it, or thin it out first.")
        if conditions and not rows:
            place = conditions[0][0]
            raise no_row(self.source, where, (cells[place] for _, cells in self.cells() if place < len(cells)))
        notes = list(self.notes)
        if short is not None:
            notes.append(f"row {short}, the last one, is incomplete and was left out.")
        if self.decimal_comma:
            notes.append("decimal commas were read as decimal points.")
        values = {place: np.frombuffer(column, dtype=np.float64).copy() for place, column in columns.items()}
        return Numbers(np.frombuffer(rows, dtype=np.int64).copy(), values, written, notes)

    def _text(self, place: int, row: int, conditions: Sequence[tuple[int, str]]) -> BsaError:
        """The error of a column with texts, of which the first stands in a row."""
        chosen = [
            cells[place]
            for _, cells in self.cells()
            if len(cells) > place and all(same(cells[k], value) for k, value in conditions)
        ]
        texts = [cell for cell in chosen if number_in(cell, self.decimal_comma) is None]
        name = self.header[place]
        return no_number(self.source, f"{self.place}row {row}", name, texts[0], len(texts), len(chosen))


def find_table(text: str, source: str) -> Table:
    """Find the header and the first row of numbers.

    Raises `BsaError` if there is no table, or a header without rows.
    """
    lines = lines_of(text)
    said = next(filter(None, map(_SAYS_ITS_LENGTH.search, lines[:_PREAMBLE_LINES])), None)
    begin = 0 if said is None else max(int(said[1]) - 1, 0)
    start = min(len(lines), begin + _PREAMBLE_LINES)
    for separator in _SEPARATORS:
        top = [split(line, separator) for line in lines[:start]]
        first = _first_row(top, begin)
        if first is None:
            continue
        header, units = _header(top, first)
        comma = have_decimal_commas(top[first:])
        return Table(source, header, units, partial(rows_from, lines, first, separator, source), separator, comma)
    heading = next((line for line in lines[:start] if len(split(line, ",")) > 1 or len(split(line, ";")) > 1), None)
    if heading is not None:
        raise BsaError(
            f'{source} has a heading ("{shown(heading)}") but no rows of numbers.',
            "export the record again, with data.",
        )
    raise BsaError(
        f"{source} holds no table of numbers in its first {start} lines.",
        "give a file with one row a sample: time, voltage, current.",
    )


def lines_of(text: str) -> list[str]:
    """The lines of a text, without the quotation marks around a whole line (older Novonix files have these)."""
    # `splitlines` would also cut at form feeds and the like, and row numbers would not be those of an editor.
    return list(map(_unquoted, text.replace("\r\n", "\n").replace("\r", "\n").split("\n")))


def _unquoted(line: str) -> str:
    whole = line[:1] == line[-1:] == '"' and line.count('"') == 2
    return line[1:-1] if whole else line


def split(line: str, separator: str | None) -> list[str]:
    """The cells of a line."""
    if separator is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return []


def is_number(cell: str) -> bool:
    """Whether a cell is a number, also with a decimal comma: between commas it is in quotation marks."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def is_missing(cell: str) -> bool:
    """Whether a cell is empty, or says that there is nothing."""
    return cell.strip().casefold() in _MISSING


def first_filled(cells: Iterable[str]) -> str:
    """The first cell that holds something; empty where none does."""
    return next((cell for cell in cells if not is_missing(cell)), "")


def have_decimal_commas(rows: Iterable[Sequence[str]]) -> bool:
    """Whether one of the first rows of numbers has decimal commas."""
    return any(map(_has_decimal_commas, islice(rows, FIRST_ROWS)))


def _has_decimal_commas(cells: Sequence[str]) -> bool:
    """Whether a row of numbers has decimal commas; one beside a decimal point parts thousands."""
    commas = any("," in cell and "." not in cell and is_number(cell) for cell in cells)
    return commas and not any("." in cell and is_number(cell) for cell in cells)


def _first_row(top: Sequence[Sequence[str]], begin: int) -> int | None:
    """The line that begins the numbers; a lone row of numbers is of a preamble where a header with rows follows."""
    begins = (k for k in range(begin, len(top)) if _numeric(top, k))
    first = next(begins, None)
    if first is None or not _is_of_words(_next(top, first)):
        return first
    return next((k for k in begins if _is_of_names(top[k - 1])), first)


def _next(top: Sequence[Sequence[str]], index: int) -> Sequence[str]:
    return next((cells for cells in top[index + 1 :] if any(cells)), ())


def _is_of_words(cells: Sequence[str]) -> bool:
    """Whether a line has cells, of which none is or may be a number."""
    return any(cells) and not any(is_number(cell) or is_missing(cell) for cell in cells if cell)


def _is_of_names(cells: Sequence[str]) -> bool:
    """Whether a line may be the header of a table with a time, a voltage and a current, or their units."""
    return _is_of_words(cells) and sum(map(bool, cells)) >= 3


def _numeric(top: Sequence[Sequence[str]], index: int) -> bool:
    """Whether the line begins the numbers: two numbers in it, and no fewer cells in the next line."""

    def looks(cells: Sequence[str]) -> bool:
        return len(cells) >= 2 and sum(map(is_number, cells)) >= 2

    if not looks(top[index]):
        return False
    after = _next(top, index)
    return not after or len(after) == len(top[index]) or looks(after)


def _header(top: Sequence[Sequence[str]], first: int) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
    width = len(top[first])
    above = [_uncommented(cells, width) for cells in top[:first] if len([cell for cell in cells if cell]) >= 2]
    if len(above) >= 2 and len(above[-1]) == len(above[-2]) and are_units(above[-1], above[-2]):
        return _named(above[-2]), tuple(above[-1])
    fits = above and abs(len(above[-1]) - width) <= 1
    if fits and not all(map(is_number, filter(None, above[-1]))):
        return _named(above[-1]), None
    return tuple(str(k + 1) for k in range(width)), None


def _uncommented(cells: Sequence[str], width: int) -> Sequence[str]:
    """A line above rows of a width, without a mark before it, such as that of ``# time voltage current``."""
    return cells[1:] if len(cells) > width and cells[0] in _COMMENTS else cells


def are_units(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a row beneath names holds units: all in brackets, or all known ones of columns with a name."""
    filled = [cell for cell in cells if cell]
    if all(cell[0] in "[(" and cell[-1] in "])" for cell in filled):
        return bool(filled)
    named = all(name and not is_number(name) for cell, name in zip(cells, names, strict=True) if cell)
    return named and not _are_known(names) and _are_known(filled)


def _are_known(units: Sequence[str]) -> bool:
    return all(unicodedata.normalize("NFKC", unit).casefold() in _UNITS for unit in units if unit)


def _named(cells: Sequence[str]) -> tuple[str, ...]:
    # A separator at the end of each line makes a last column without a name.
    kept = list(cells)
    while kept and not kept[-1]:
        kept.pop()
    return tuple(kept)


def rows_from(lines: list[str], first: int, separator: str | None, source: str) -> Iterator[tuple[int, list[str]]]:
    """The number, from 1, and the cells of each line from one on that is not blank."""
    if separator is None:
        for number, line in enumerate(lines[first:], first + 1):
            if line.strip():
                yield number, line.split()
        return
    reader = csv.reader(lines[first:], delimiter=separator)
    before = 0
    while True:
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise BsaError(
                f"{source}: row {first + reader.line_num} cannot be read ({shown(error)}).", "repair or remove the row."
            ) from None
        if reader.line_num - before > 1:
            raise BsaError(
                f"{source}: a quotation mark opened in row {first + before + 1} is not closed.", "repair the row."
            )
        before = reader.line_num
        if any(cell.strip() for cell in cells):
            yield first + reader.line_num, cells


def row_conditions(header: Sequence[str], where: Mapping[str, str], source: str) -> list[tuple[int, str]]:
    """Places of the columns that a row is chosen by, and the values that they must have.

    Raises `BsaError` if there is no such column.
    """
    found = []
    for name, value in where.items():
        if name not in header:
            raise no_column(name, header, source)
        found.append((header.index(name), value))
    return found


def no_column(name: str, header: Sequence[str], source: str) -> BsaError:
    """The error of a column that a table does not have, with the nearest one and all others."""
    nearest = did_you_mean(name, header)
    hint = shown(f"{nearest} ", 100) * bool(nearest) + f"Columns: {listed(header)}."
    return BsaError(f'"{shown(name)}" is not a column of {source}.', hint)


def same(cell: str, value: str) -> bool:
    """Whether a cell holds a value, as text or as a number."""
    cell = cell.strip()
    if cell == value:
        return True
    try:
        return float(cell) == float(value)
    except ValueError:
        return False


def no_row(source: str, where: Mapping[str, str], cells: Iterable[object]) -> BsaError:
    """The error that says which values the first column of ``where`` has instead."""
    seen: dict[str, None] = {}
    for cell in cells:
        seen.setdefault(str(cell).strip())
    wanted = " and ".join(f"{shown(name)} is {shown(value)}" for name, value in where.items())
    return BsaError(f"{source} has no row where {wanted}.", f"values there: {listed(seen, 8)}.")


def _refuse_width(table: Table, row: int, word: str) -> None:
    hint = (
        "numbers with decimal commas? Export with points, or with semicolons between the cells."
        if word == "more" and table.separator == ","
        else "repair or remove the row."
    )
    raise BsaError(f"{table.source}: row {row} has {word} cells than the {len(table.header)} columns.", hint)


def number_in(cell: str, decimal_comma: bool) -> float | None:
    """A cell as a number, NaN where it says that there is none; None where it is another text."""
    try:
        return float(cell)
    except ValueError:
        pass
    if is_missing(cell):
        return float("nan")
    if decimal_comma:
        try:
            return float(cell.replace(",", "."))
        except ValueError:
            pass
    return None


def numbers_in(cells: Iterable[str], decimal_comma: bool) -> FloatArray:
    """Cells as numbers; NaN where one is none, or larger than any that is measured."""
    found = np.array([np.nan if (value := number_in(cell, decimal_comma)) is None else value for cell in cells])
    return np.where(np.abs(found) < 1e15, found, np.nan)


def no_number(source: str, place: str, column: str, text: str, count: int, rows: int) -> BsaError:
    """The error of a column that has texts in ``count`` of ``rows`` rows, the first at a place."""
    hint = "repair or remove the row." if count == 1 else "repair or remove these rows."
    if ":" in text:
        hint = "give times in seconds (or minutes or hours, with the unit in the header)."
    return BsaError(
        f'{source}: {place}, column "{shown(column)}": "{shown(text.strip())}" is not a number'
        f"{f' ({count} of {rows} rows are so)' * (count > 1)}.",
        hint,
    )
