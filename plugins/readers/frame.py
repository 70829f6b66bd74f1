"""A pandas DataFrame read as a text table is: the same names, units and checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from .arrays import ArrayTable
from .assembly import read_table

if TYPE_CHECKING:
    import pandas


def read_frame(frame: pandas.DataFrame, options: ReadOptions, name: str) -> Samples:
    """Read the signals of a DataFrame.

    One row a sample; columns are recognised by name as those of a text table are, or said with ``options.columns``.
    Rows count from 1 in messages. Raises `BsaError` naming the column or the row at fault.
    """
    if len(frame) == 0:
        raise BsaError(f"{shown(name)} has no rows.", "give a DataFrame with one row for each sample.")
    header = tuple(str(column) for column in frame.columns)
    columns = [frame.iloc[:, place].to_numpy() for place in range(len(header))]
    return read_table(ArrayTable(shown(name), header, columns), options)
