"""A table whose columns a file gives as arrays: binary files, workbooks and DataFrames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.errors import BsaError
from ...core.trajectory import FloatArray
from .source import MAX_SAMPLES
from .table import FIRST_ROWS, Numbers, first_filled, no_number, no_row, number_in, row_conditions, same


@dataclass(frozen=True)
class ArrayTable:
    """Columns of one length, read with the names, units and checks of a text table."""

    source: str  # Printable name of the file.
    header: tuple[str, ...]  # Names of the columns.
    # Numbers, texts or any objects; a cell that is None, blank or none of pandas is missing. Shape (n,).
    columns: Sequence[NDArray[Any]]
    units: ClassVar[tuple[str, ...] | None] = None  # There is no row of units; see `Table`.
    decimal_comma: ClassVar[bool] = False

    def first(self, place: int) -> str:
        """The first cell of a column that holds something; see `Table.first`."""
        return first_filled(_texts(self.columns[place][:FIRST_ROWS]))

    def numbers(self, wanted: Sequence[int], where: Mapping[str, str], texts: Sequence[int] = ()) -> Numbers:
        """Read columns; see `Table.numbers`."""
        size = len(self.columns[0])
        if size > MAX_SAMPLES:
            raise BsaError(f"{self.source} has more than {MAX_SAMPLES} rows.", "cut it, or thin it out first.")
        rows = np.arange(1, size + 1)
        keep = np.ones(size, dtype=np.bool_)
        for place, value in row_conditions(self.header, where, self.source):
            keep &= np.array([same(str(cell), value) for cell in self.columns[place].tolist()], dtype=np.bool_)
        if not keep.any() and where:
            raise no_row(self.source, where, self.columns[self.header.index(next(iter(where)))].tolist())
        return Numbers(
            rows[keep],
            {place: self._floats(self.columns[place][keep], rows[keep], self.header[place]) for place in wanted},
            {place: _texts(self.columns[place][keep]) for place in texts},
        )

    def _floats(self, column: NDArray[Any], rows: NDArray[np.int64], name: str) -> FloatArray:
        if column.dtype.kind == "m":
            return np.asarray(column / np.timedelta64(1, "s"), dtype=np.float64)
        if column.dtype.kind in "fiub":
            return np.asarray(column, dtype=np.float64)
        values = [_number(cell) for cell in column.tolist()]
        if None in values:
            k = values.index(None)
            raise no_number(self.source, f"row {rows[k]}", name, str(column[k]), values.count(None), len(values))
        return np.array(values, dtype=np.float64)


def _number(cell: Any) -> float | None:
    """A cell as a number, NaN where it is empty; None where it is anything else."""
    try:
        return float(cell)
    except (TypeError, ValueError):
        return number_in(str(cell), decimal_comma=False)


def _texts(column: NDArray[Any]) -> list[str]:
    """The cells as they would be written."""
    return list(map(str, np.datetime_as_string(column) if column.dtype.kind == "M" else column.tolist()))
