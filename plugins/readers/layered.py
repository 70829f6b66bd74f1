"""Neware's layered text exports: lines of cycles, of steps and of records, each further indented."""

from collections.abc import Iterator, Sequence

from ...core.errors import BsaError
from ...core.printable import shown
from .table import Table, have_decimal_commas, is_number, lines_of, rows_from, split

_SEPARATORS = (",", ";", "\t")

_LAYERS = 3
"""Lines of names: of a cycle, of a step (indented by a cell) and of a record (by two)."""

_HEAD = 20_000
"""Characters in which these lines end: what is no layered export is not parted into lines for it."""

_CARRIED = ("Cycle Index", "Step Index")
"""Names of the columns with the numbers of the cycle and of the step, in any language of the file."""


def layered_table(text: str, source: str) -> Table | None:
    """The records of a layered export, with the numbers of their cycle and step before them; None of another text."""
    top = lines_of(text[:_HEAD])
    first = next((k for k, line in enumerate(top) if line.strip()), 0)
    for separator in _SEPARATORS:
        names = [split(line, separator) for line in top[first : first + _LAYERS]]
        if len(names) == _LAYERS and all(map(_is_layer, names, range(_LAYERS))):
            return _table(lines_of(text), first + _LAYERS, separator, names, source)
    return None


def _is_layer(names: Sequence[str], depth: int) -> bool:
    """Whether a line names columns behind as many empty cells as its layer has."""
    return not any(names[:depth]) and any(names[depth : depth + 1]) and not any(map(is_number, names))


def _table(lines: list[str], first: int, separator: str, names: Sequence[Sequence[str]], source: str) -> Table:
    of_cycle, record = _width(names[0]), names[2][: _width(names[2])]

    def cells() -> Iterator[tuple[int, list[str]]]:
        cycle = step = ""
        for number, row in rows_from(lines, first, separator, source):
            if row[0].strip():
                # The line of a cycle's first step may stand behind that of the cycle, in the same line.
                cycle, step = _numbered(row[0], number, source), "".join(row[of_cycle : of_cycle + 1])
            elif row[1].strip():
                step = _numbered(row[1], number, source)
            else:
                yield number, [cycle, step, *row[2:]]

    comma = have_decimal_commas(row for _, row in cells())
    return Table(source, (*_CARRIED, *record[2:]), None, cells, separator, comma)


def _width(names: Sequence[str]) -> int:
    """Number of columns up to the last one with a name."""
    return max(k for k, name in enumerate(names, 1) if name)


def _numbered(cell: str, row: int, source: str) -> str:
    """The number of a cycle or a step, with which its line begins."""
    if not is_number(cell):
        raise BsaError(
            f'{source}: row {row} begins with "{shown(cell.strip())}", which is no number of a cycle or a step.',
            "repair or remove the row; records begin with two empty cells.",
        )
    return cell
