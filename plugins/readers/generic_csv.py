"""Any text table with a time, a voltage and a current column."""

from __future__ import annotations

from pathlib import Path

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .columns import SIGNALS, resolve
from .source import head, load_text
from .table import Table, find_table, numbers

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".bdf")


class GenericCsv:
    """Reads tables parted by commas, semicolons, tabs or white space, also gzipped.

    Columns are recognised by common names (``Time [s]``, ``voltage_V``, ``I[A]``), or said with ``columns``;
    a table without names has columns ``1``, ``2``, ...
    """

    def matches(self, path: Path) -> bool:
        """Whether the name is that of a text table."""
        return is_text_table(path)

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        text, notes = load_text(path)
        return read_table(find_table(text, shown(path.name)), options, notes)


def is_text_table(path: Path) -> bool:
    """Whether the name, without ``.gz``, ends like that of a text table."""
    plain = Path(path.stem) if path.suffix.lower() == ".gz" else path
    return plain.suffix.lower() in SUFFIXES and path.is_file()


def first_lines(path: Path, count: int) -> list[str]:
    """The first lines of a text file, for a reader's ``matches``; none of a binary one."""
    data = head(path)
    if b"\0" in data:
        return []
    return data.decode("utf-8-sig", errors="replace").splitlines()[:count]


def read_table(table: Table, options: ReadOptions, notes: list[str], ambient_column: int | None = None) -> Samples:
    """Read the signals of a table.

    Parameters
    ----------
    table : Table
        Where the numbers are.
    options : ReadOptions
        What the user said.
    notes : list of str
        What was assumed so far.
    ambient_column : int, optional
        Place of a column with the ambient temperature in degC.

    Raises
    ------
    BsaError
        Naming the file, the row or column at fault and its value.
    """
    if options.sheet is not None:
        raise BsaError(
            f'{table.source} is a text file; it has no sheet "{shown(options.sheet)}".',
            "leave out --sheet; --where COLUMN=VALUE chooses rows.",
        )
    found = resolve(table.header, table.units, options, table.source)
    wanted = {column.index: column.name for column in found.values()}
    if ambient_column is not None:
        wanted[ambient_column] = table.header[ambient_column]
    read = numbers(table, wanted, options.where)
    signals: dict[str, FloatArray] = {
        signal: found[signal].in_si(read.values[found[signal].index]) for signal in SIGNALS if signal in found
    }
    notes = [*notes, *read.notes]
    for signal, column in found.items():
        if column.unit is None:
            taken = {"time": "s", "voltage": "V", "current": "A", "temperature": "degC"}[signal]
            notes.append(f'column "{shown(column.name)}" has no unit; it was taken to be in {taken}.')
    if "current" not in signals:
        assert options.constant_current_a is not None
        signals["current"] = signals["time"] * 0.0 + options.constant_current_a
        notes.append(f"the file has no current; {options.constant_current_a:g} A was used throughout, as said.")
    ambient = None
    if ambient_column is not None:
        ambient = _first_finite(read.values[ambient_column])
    return Samples(
        source=table.source,
        rows=read.rows,
        time=signals["time"],
        voltage=signals["voltage"],
        current=signals["current"],
        temperature=signals.get("temperature"),
        names={signal: shown(column.name) for signal, column in found.items()},
        notes=tuple(notes),
        ambient_k=None if ambient is None else ambient + 273.15,
    )


def _first_finite(values: FloatArray) -> float | None:
    return next((float(value) for value in values if value == value and abs(value) < 1e3), None)
