"""Gamry's ``.DTA`` files: one or several curves, or a spectrum, each with a line of names and a line of units."""

import re
from collections.abc import Container, Iterator, Sequence
from itertools import pairwise

from ...core.errors import BsaError
from ...core.record import ReadOptions
from .table import Table, have_decimal_commas, lines_of, number_in, split

_FIRST_LINE = "EXPLAIN"

_CURVE = re.compile(r"CURVE\d*\tTABLE\b")
"""What begins the line above a curve; that of the open-circuit voltage measured before it is named OCVCURVE."""

_SPECTRUM = re.compile(r"ZCURVE\d*\tTABLE\b")
"""What begins the line above an impedance spectrum, before which the open-circuit voltage is measured."""

_NAMES = {"Vf": "Voltage", "Im": "Current", "Vdc": "Voltage"}
"""Gamry's names, as other readers know them."""

_TIME = "T"

_AGAINST = re.compile(r"\s+vs\. Ref\.$")
"""Stands behind the unit of a voltage, whether there is a reference electrode or not."""


def is_gamry_s(text: str) -> bool:
    """Whether a text, or its first line, is that of a Gamry file."""
    return text.startswith(_FIRST_LINE)


def gamry_table(text: str, source: str, options: ReadOptions) -> Table | None:
    """The curves of a file, one below the other and numbered in a column of steps; None of another text.

    Raises `BsaError` if curves have different columns.
    """
    lines = _lines(text)
    curves = [rows for k, line in enumerate(lines) if _CURVE.match(line) and (rows := _rows_below(lines, k + 3))]
    if not curves:
        return None
    names, units = _heading(lines, curves, source)
    comma = have_decimal_commas(split(lines[k], "\t") for k in curves[0])
    time = names.index(_TIME) if _TIME in names else None
    shifts = [0.0] * len(curves) if time is None else _shifts(lines, curves, time, comma)

    def cells() -> Iterator[tuple[int, list[str]]]:
        for curve, (rows, shift) in enumerate(zip(curves, shifts, strict=True), 1):
            for k in rows:
                row = [str(curve), *split(lines[k], "\t")[1:]]
                if time is not None and shift:
                    row[time : time + 1] = [_later(cell, shift, comma) for cell in row[time : time + 1]]
                yield k + 1, row

    kept = {*options.signal_columns.values(), *options.where}
    header = ("Step", *(_name(name, kept) for name in names[1:]))
    return Table(source, header, units, cells, "\t", comma, notes=_notes(shifts))


def gamry_spectrum(text: str, source: str) -> Table | None:
    """The impedance spectrum of a file; None of another text, and of a file that has curves of a record too."""
    lines = _lines(text)
    if any(_CURVE.match(line) for line in lines):
        return None
    rows = next((_rows_below(lines, k + 3) for k, line in enumerate(lines) if _SPECTRUM.match(line)), range(0))
    if not rows:
        return None
    names, units = _heading(lines, [rows], source)
    comma = have_decimal_commas(split(lines[k], "\t") for k in rows)

    def cells() -> Iterator[tuple[int, list[str]]]:
        return ((k + 1, split(lines[k], "\t")[1:]) for k in rows)

    header = tuple(_NAMES.get(name, name) for name in names[1:])
    return Table(source, header, units[1:], cells, "\t", comma)


def _lines(text: str) -> Sequence[str]:
    """The lines of a Gamry file; none of another text."""
    return lines_of(text) if is_gamry_s(text) else []


def _rows_below(lines: Sequence[str], first: int) -> range:
    """The lines of a curve from its first row on; they begin with a tab."""
    return range(first, next((k for k in range(first, len(lines)) if not lines[k].startswith("\t")), len(lines)))


def _heading(lines: Sequence[str], curves: Sequence[range], source: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of the columns, which all curves share."""
    headings = [lines[rows.start - 2 : rows.start] for rows in curves]
    other = next((rows for rows, heading in zip(curves, headings, strict=True) if heading != headings[0]), None)
    if other is not None:
        raise BsaError(
            f"{source}: the curve in row {other.start - 2} has other columns or units than the one in row "
            f"{curves[0].start - 2}.",
            "give each of them as a file of its own.",
        )
    names, units = (split(line, "\t") for line in headings[0])
    return tuple(names), tuple(_AGAINST.sub("", unit) for unit in units)


def _shifts(lines: Sequence[str], curves: Sequence[range], time: int, comma: bool) -> list[float]:
    """What is added to the time of each curve, in its unit: where the clock restarts, the end of the one before."""
    shifts = [0.0]
    for before, rows in pairwise(curves):
        last, first = (_number(lines[k], time, comma) for k in (before[-1], rows[0]))
        shifts.append(shifts[-1] + (last if first < last else 0.0))
    return shifts


def _number(line: str, place: int, comma: bool) -> float:
    """The number in a cell of a line, 0 where there is none: its row is refused where it is read."""
    return number_in("".join(split(line, "\t")[place : place + 1]), comma) or 0.0


def _later(cell: str, shift: float, comma: bool) -> str:
    value = number_in(cell, comma)
    return cell if value is None else repr(value + shift)


def _notes(shifts: Sequence[float]) -> tuple[str, ...]:
    if not any(shifts):
        return ()
    return (
        f"the clock restarts with each of {len(shifts)} curves; each was taken to begin when the one before it ended.",
    )


def _name(name: str, kept: Container[str]) -> str:
    """The name that other readers know; a column that the user names keeps its own."""
    return name if name in kept else _NAMES.get(name, name)
