"""From the columns of a table, wherever it stands, to the signals of a cell."""

import shlex
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.printable import listed, shown
from ...core.reading.clock import RESTART_S
from ...core.reading.samples import Extra, Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .columns import EXTRA, Column, ambient_in, named, resolve, unit_of
from .dates import clock_s, elapsed_s, exchanged, is_clock_or_date, is_date, is_of_days, seconds_of
from .several_cells import refuse_several_cells, telling_cells
from .table import Numbers

_TAKEN = {"time": "s", "voltage": "V", "current": "A", "temperature": "degC"}


class AnyTable(Protocol):
    """A table of any kind of file."""

    @property
    def source(self) -> str:
        """Printable name of the file."""

    @property
    def header(self) -> tuple[str, ...]:
        """Names of the columns."""

    @property
    def units(self) -> tuple[str, ...] | None:
        """Row of units beneath the header."""

    @property
    def decimal_comma(self) -> bool:
        """Whether numbers that stand as text are written like ``3,7``."""

    def first(self, place: int) -> str:
        """The first cell of a column."""

    def numbers(self, wanted: Mapping[int, str], where: Mapping[str, str], texts: Sequence[int] = ()) -> Numbers:
        """Read columns; see `Table.numbers`."""


def read_table(table: AnyTable, options: ReadOptions, notes: Sequence[str] = ()) -> Samples:
    """Read the signals of a table. Raises `BsaError` naming the file, the row or column at fault and its value."""
    found = resolve(table.header, table.units, options, table.source)
    taken = {column.index for column in found.values()}
    extra: dict[Extra, int] = {}
    for name, names in EXTRA.items():
        place = named(table.header, names)
        if place is not None and place not in taken:
            extra[name] = place
    ambient, unknown = ambient_in(table.header, table.units)
    time = found["time"]
    written = is_clock_or_date(table.first(time.index))  # as 10:00:00, or as a date
    numeric = [column for column in found.values() if not (written and column is time)]
    cells = [] if options.join else telling_cells(table.header, {*taken, *extra.values()})
    texts = [*extra.values(), *([] if ambient is None else [ambient.index]), *([time.index] if written else []), *cells]
    read = table.numbers({column.index: column.name for column in numeric}, options.where, texts)
    refuse_several_cells(table.header, {place: read.texts[place] for place in cells}, table.source)
    signals = {column.signal: column.in_si(read.values[column.index]) for column in numeric}
    said = [*notes, *read.notes]
    if unknown and options.ambient_c is None:
        said.append(unknown)
    said_by_file = _extra(table, extra, read)
    if ambient is not None:
        said_by_file["ambient_k"] = kelvin(ambient, read.texts[ambient.index], table.decimal_comma)
    own = said_by_file.pop("date", None)
    date, dated = own, extra.get("date", time.index)
    if written:
        signals["time"], date = elapsed_s(read.texts[time.index], table.source, time.name, own)
        said.append(
            f'the time is that of column "{shown(time.name)}", which begins at {shown(read.texts[time.index][0])}.'
        )
        if clock_s(table.first(time.index)) is None:
            own, dated = date, time.index
        date = own if date is None else date
    elif is_date(signals["time"]):
        date = signals["time"] if own is None else own
        signals["time"] = signals["time"] - signals["time"][0]
    day_first: bool | None = None
    if date is not None:
        dates, day_first = _dated(date, date if own is None else own, read.texts.get(dated, []))
        said_by_file |= dates
    bare = [column for column in numeric if column.unit is None]
    if bare:
        verb = "has no unit; it was" if len(bare) == 1 else "have no units; they were"
        taken_in = ", ".join(_TAKEN[column.signal] for column in bare)
        said.append(f"{listed(column.name for column in bare)} {verb} taken to be in {taken_in}.")
    said += [
        f'column "{shown(column.name)}" was read in {options.units[column.signal]}, as said, not in '
        f"{shown(column.written)}, as the file has it."
        for column in numeric
        if column.written is not None
    ]
    if "current" not in signals:
        assert options.constant_current_a is not None
        signals["current"] = signals["time"] * 0.0 + options.constant_current_a
        said.append(f"the file has no current; {options.constant_current_a:g} A was used throughout, as said.")
    elif options.constant_current_a is not None:
        said.append(
            f'the current of column "{shown(found["current"].name)}" was used, not the constant '
            f"{options.constant_current_a:g} A that was said: that is for a file without a current."
        )
    return Samples(
        source=table.source,
        rows=read.rows,
        time=signals["time"],
        voltage=signals["voltage"],
        current=signals["current"],
        temperature=signals.get("temperature"),
        names={signal: shown(column.name) for signal, column in found.items()},
        tests_by=_tests_by(table, signals["time"], options) if not {"date", "cycle"} & set(said_by_file) else None,
        without_unit=tuple(column.signal for column in bare),
        notes=tuple(said),
        day_first=day_first,
        extra=said_by_file,
    )


def _dated(date: FloatArray, own: FloatArray, texts: Sequence[str]) -> tuple[dict[Extra, FloatArray], bool | None]:
    """What is told by dates, and whether the day comes before the month in them.

    ``own`` are those of the column with these texts, ``date`` has also the time of the day, if a clock beside it tells
    one.
    """
    found: dict[Extra, FloatArray] = {"day" if is_of_days(date) else "date": date}
    day_first, other = exchanged(texts)
    if other is not None:
        found["other_date"] = other + (date - own)
    return found, day_first


def _extra(table: AnyTable, places: Mapping[Extra, int], read: Numbers) -> dict[Extra, FloatArray]:
    """What can be read of the columns; one that is no number is no step, but nothing is wrong with the file."""
    found: dict[Extra, FloatArray] = {}
    for name, place in places.items():
        texts = read.texts[place]
        values = seconds_of(texts) if name == "date" else numbers(texts, table.decimal_comma)
        if values is None or not np.isfinite(values).any():
            continue
        if name.endswith("_ah") and (unit_of(table.header, table.units, place) or "").casefold().startswith("m"):
            values = values / 1000.0
        found[name] = values
    return found


def _tests_by(table: AnyTable, time: FloatArray, options: ReadOptions) -> tuple[str, ...] | None:
    """The columns that have another value in each test of a file whose clock restarts, with that of the first one."""
    with np.errstate(invalid="ignore"):
        begins = np.flatnonzero(np.diff(time) < -RESTART_S) + 1
    return None if len(begins) == 0 or options.join else told_apart_by(table, options, begins)


def told_apart_by(
    table: AnyTable, options: ReadOptions, begins: NDArray[np.intp], rows: NDArray[np.intp] | None = None
) -> tuple[str, ...]:
    """The columns with another value from each of these rows on, as ``COLUMN=VALUE`` of what stands before the first.

    ``rows`` are those that count; left out, all that the options keep.
    """
    found = []
    for place, name in enumerate(table.header):
        cells = table.numbers({}, options.where, [place]).texts[place]
        if rows is not None:
            cells = [cells[row] for row in rows]
        changes = [k for k, (one, two) in enumerate(pairwise(cells), 1) if one != two]
        if changes == begins.tolist() and len({cells[k] for k in changes} | {cells[0]}) == len(changes) + 1:
            found.append(shlex.quote(f"{shown(name)}={shown(cells[0].strip())}"))
    return tuple(found)


def numbers(texts: Sequence[str], decimal_comma: bool) -> FloatArray:
    """Cells as numbers; NaN where one is none."""
    return np.array([_number(text.replace(",", ".") if decimal_comma else text) for text in texts])


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return float("nan")
    return value if abs(value) < 1e15 else float("nan")


def kelvin(column: Column, texts: Sequence[str], decimal_comma: bool) -> FloatArray:
    """A column of temperatures in K; NaN where a cell holds none."""
    values = numbers(texts, decimal_comma)
    return column.in_si(np.where(np.abs(values) < 1e3, values, np.nan))
