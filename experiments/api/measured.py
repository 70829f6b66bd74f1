"""Measured data as a person has them: files, DataFrames, records that are read already."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from ...core.errors import BsaError
from ...core.printable import shown, with_article
from ...core.record import ReadOptions, Record
from ..checked_options import FIELDS, as_numbers
from ..file_reading import FileReading
from ..read_options import one_each, reading, readings
from ..task_request import Records

if TYPE_CHECKING:
    import pandas

Data: TypeAlias = "str | Path | Record | pandas.DataFrame"
"""One record: a file, a DataFrame, or what `read_record` returned."""

READING = tuple(name for name in inspect.signature(readings).parameters if name != "join")
"""The options of reading a record."""


def read_record(
    data: str | Path | Sequence[str | Path] | pandas.DataFrame,
    *,
    name: str | None = None,
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    current_sign: str = "charge-positive",
    constant_current: float | None = None,
    current_offset: float = 0.0,
    voltage_lag: float | None = None,
    where: Mapping[str, Any] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    reader: str | None = None,
    reader_option: Mapping[str, Any] | None = None,
    temperature: float | None = None,
) -> Record:
    """Read and check one record. The options are those of ``bsa run``, with mappings for ``KEY=VALUE``.

    Parameters
    ----------
    data : path, sequence of paths or pandas.DataFrame
        A cycler's file; the files of one cell, or a folder of them, which are joined by date; or one row a sample
        with columns such as ``"Time [s]"``, ``"Current [A]"``, ``"Voltage [V]"`` and, where known,
        ``"Temperature [degC]"``. Without a unit in its name a column is in s, A, V or degC.
    name : str, optional
        What the record is called in messages and reports, in place of its file's name.
    column, unit : mapping, optional
        Column and unit of a signal (``"time"``, ``"current"``, ``"voltage"``, ``"temperature"``); a column by its name,
        or its number where it has none.
    current_sign : {'charge-positive', 'discharge-positive', 'auto'}
        Sign of the current in ``data``: cyclers write it positive on charge.
    constant_current : float, optional
        Current in A where ``data`` has none, in that sign.
    current_offset : float
        What the instrument adds to every current that is not zero, in A, positive on charge whatever the sign.
    voltage_lag : float, optional
        How much later than the current the instrument writes the voltage, in s; left out, what a varying current shows.
    where : mapping, optional
        Keep only the rows with these values.
    cycles : str or int, optional
        Cycles to keep, ``"2-4"`` or ``1``.
    sheet : str, optional
        Sheet of a workbook.
    reader, reader_option : optional
        Reader to use, and its own options; left out, the reader that recognises the file.
    temperature : float, optional
        Ambient temperature in degC, in place of what ``data`` says.

    Returns
    -------
    Record
        ``trajectory`` in SI units (s, A, V, K), its current **positive on discharge**, cut into steps; ``notes`` say
        what was assumed or repaired.

    Raises
    ------
    BsaError
        If the data cannot be read, naming the row or column at fault.
    """
    read = reading(
        column,
        unit,
        current_sign,
        constant_current,
        current_offset,
        voltage_lag,
        where,
        cycles,
        sheet,
        reader,
        reader_option,
        temperature,
    )
    given = data if isinstance(data, list | tuple) else [data]
    files = [Path(one) for one in given if isinstance(one, str | Path)]
    if files and len(files) == len(given):
        record = read.record(data if isinstance(data, str | Path) else files)
        return record if name is None else replace(record, name=name)
    return _read_frame(data, read.options, name or "DataFrame")


def listed(data: Data | Sequence[Data] | None) -> list[Data]:
    """One or several data, or none, as a list."""
    if data is None:
        return []
    return [data] if isinstance(data, (str, Path, Record)) or not isinstance(data, Sequence) else list(data)


def source(data: Data, options: ReadOptions, number: int) -> Path | Record:
    """What a task reads: a file, or a record.

    Raises `BsaError` if it is neither, or a record that is read already comes with options for reading.
    """
    if isinstance(data, (str, Path)):
        return Path(data)
    if not isinstance(data, Record):
        return _read_frame(data, options, f"DataFrame {number}")
    if options != ReadOptions():
        given = ", ".join(sorted(FIELDS.get(name, name) for name in options.model_dump(exclude_defaults=True)))
        raise BsaError(
            f"options for reading ({given}) were given for {shown(data.name)}, which is read already.",
            "give them to read_record instead.",
        )
    return data


def records_of(
    data: Data | Sequence[Data] | None,
    holdout: Data | Sequence[Data] | None,
    reads: Sequence[FileReading],
    initial_soc: Any,
    **how: Any,
) -> Records:
    """Fitted and held-out data as records, of which ``reads`` says how they are read (`readings`).

    ``how`` are further fields of `Records`. Raises `BsaError` if one is no data, or the options do not fit them.
    """
    fitted = listed(data)
    if data is not None and not fitted:
        raise BsaError("data is empty.", "give one record at least.")
    everything = [*fitted, *listed(holdout)]
    read = zip(everything, one_each(reads, len(everything)), strict=True)
    found = [source(one, how.options, number) for number, (one, how) in enumerate(read, 1)]
    socs = as_numbers(initial_soc, "--initial-soc")
    return Records(found[: len(fitted)], found[len(fitted) :], reads, socs, **how)


def _read_frame(data: Any, options: ReadOptions, name: str) -> Record:
    if not (hasattr(data, "to_csv") and hasattr(data, "columns")):
        raise BsaError(
            f"{with_article(type(data).__name__)} is no record.",
            "give a path, a pandas DataFrame, or what bsa.read_record returned.",
        )
    from ...core.reading.checks import to_record
    from ...plugins.readers.frame import read_frame

    return to_record(read_frame(data, options, name), options)
