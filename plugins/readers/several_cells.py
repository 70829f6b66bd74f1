"""Tables whose rows are of several cells."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from ...core.errors import BsaError
from ...core.printable import counted, listed, shown
from .columns import split_name
from .table import is_missing

_CELLS = (
    *("cell", "cellid", "cellname", "cellnumber", "cellno", "cellindex", "battery", "batteryid", "batteryname"),
    *("batteryno", "barcode", "serialnumber", "sampleid", "samplename", "zelle", "zellnummer", "zellname"),
    *("电池条码", "电池编号", "条码"),
)
"""Names of columns that say which cell a row is of, folded: with two values it is of two cells."""

_CHANNELS = (
    *("channel", "channelid", "channelindex", "channelnumber", "channelno", "channelname", "chan", "chanid", "chid"),
    *("kanal", "kanalnummer", "voie", "testid", "testname", "通道", "通道号"),
)
"""Names of columns with the channel of a cycler or the test, folded: a cell that is moved has one after the other, and
only cells that are written in turn come back to an earlier one."""

_ROWS_EACH = 10
"""Rows that a cell has at least on average: a column with more values counts something else."""


def telling_cells(header: Sequence[str], taken: Iterable[int]) -> list[int]:
    """Places of the columns that may say which cell a row is of, without those that are ``taken``."""
    names = [split_name(name)[0] for name in header]
    return [k for k, name in enumerate(names) if name in (*_CELLS, *_CHANNELS) and k not in taken]


def refuse_several_cells(header: Sequence[str], columns: Mapping[int, Sequence[str]], source: str) -> None:
    """Refuse a table whose rows are of several cells.

    ``columns`` are the cells of those of `telling_cells`, by their places. Raises `BsaError` with the option that keeps
    one cell.
    """
    for place, cells in columns.items():
        filled = [cell.strip() for cell in cells if not is_missing(cell)]
        values = list(dict.fromkeys(filled))
        if len(values) < 2 or len(filled) < _ROWS_EACH * len(values) or not all(map(_is_label, values)):
            continue
        changes = sum(one != two for one, two in pairwise(filled))
        in_turn = changes >= len(values)
        if not in_turn and split_name(header[place])[0] not in _CELLS:
            continue
        name = shown(header[place])
        first = shlex.quote(f"{name}={shown(values[0])}")
        raise BsaError(
            f'{source}: column "{name}" has {counted(len(values), "value")} ({listed(values, 5)})'
            f"{', which alternate' * in_turn}: the rows are of several cells.",
            f"choose one with --where {first} (or say --join if all are of one cell).",
        )


def _is_label(text: str) -> bool:
    """Whether a cell of a table is a word or a whole number, and no measured one."""
    try:
        return float(text).is_integer()
    except (ValueError, OverflowError):
        return True
