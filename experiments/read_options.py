"""What a person says of files, as the readers take it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from ..core.errors import BsaError
from ..core.printable import counted
from ..core.record import ReadOptions
from ..core.validation import validated
from .checked_options import FIELDS, as_celsius, as_mapping, as_number, as_several, by_column, by_signal
from .file_reading import FileReading

Numbers: TypeAlias = "float | Sequence[float] | None"
"""One number for all records, or one for each, held-out ones last."""


def reading(*said: Any, **more: Any) -> FileReading:
    """How one file is read, from what `readings` takes. Raises `BsaError` if it is said of several."""
    return one_each(readings(*said, **more), 1)[0]


def readings(
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    current_sign: str = "charge-positive",
    constant_current: Numbers = None,
    current_offset: Numbers = None,
    voltage_lag: Numbers = None,
    where: Mapping[str, Any] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    reader: str | None = None,
    reader_option: Mapping[str, Any] | None = None,
    temperature: Numbers = None,
    join: bool = False,
) -> list[FileReading]:
    """How files are read, from what a person says: once for all of them, or for each where a number differs.

    Raises `BsaError` if an option is not valid, or two have different numbers of values.
    """
    from .tasks.record_request import parse_cycles

    given = {
        "constant_current": constant_current,
        "current_offset": current_offset,
        "voltage_lag": voltage_lag,
        "temperature": temperature,
    }
    same = {
        "columns": by_column(column, "--column"),
        "units": by_signal(unit, "--unit"),
        "where": {key: str(value) for key, value in as_mapping(where, "--where").items()},
        "cycles": None if cycles is None else parse_cycles(str(cycles)),
        "current_sign": current_sign,
        "sheet": sheet,
        "join": join,
    }
    own = as_mapping(reader_option, "--reader-option")
    return [
        FileReading(validated(ReadOptions, {**numbers, **same}, "the options of the record"), reader, own)
        for numbers in _each(given)
    ]


def _each(given: Mapping[str, Numbers]) -> list[dict[str, float]]:
    """The fields of `ReadOptions` that numbers are given for, once for all records or for each.

    Raises `BsaError` if one is no number, or two have different numbers of values.
    """
    several = {name: [_checked(name, value) for value in as_several(values)] for name, values in given.items()}
    counts = {_typed(name): len(values) for name, values in several.items() if len(values) > 1}
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{option} {counted(count, 'time')}" for option, count in counts.items())
        raise BsaError(f"{said} were given.", "give each once for all records, or once for each, in their order.")
    by_field = {field: several[name] for field, name in FIELDS.items() if several.get(name)}
    return [
        {field: values[min(place, len(values) - 1)] for field, values in by_field.items()}
        for place in range(max([1, *counts.values()]))
    ]


def _checked(name: str, value: Any) -> float:
    """The number that was given for an option for reading."""
    check = as_celsius if name == "temperature" else as_number
    return check(value, _typed(name))


def _typed(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def one_each(reads: Sequence[FileReading], count: int) -> list[FileReading]:
    """How each of so many records is read. Raises `BsaError` if it was said of another number of them."""
    if len(reads) not in (1, count):
        raise BsaError(
            f"an option for reading was given {counted(len(reads), 'time')} for {counted(count, 'record')}.",
            "give it once for all records, or once for each, in their order, held-out ones last.",
        )
    return list(reads) * (count if len(reads) == 1 else 1)
