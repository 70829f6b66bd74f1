"""MATLAB ``.mat`` files: tests anywhere in nested structs, chosen by their place and by the fields around them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from ...core.errors import BsaError
from ...core.printable import listed, shown
from ...core.reading.joining import joined
from ...core.reading.samples import Samples
from ...core.record import ReadOptions, Signal
from .arrays import ArrayTable
from .assembly import read_table
from .columns import AMBIENT, named, signal_of
from .dates import YEARS_S
from .matlab_files import load
from .table import same

_MIN_ROWS = 2
_SOC = ("refsoc", "soc", "stateofcharge")
_OCV = ("meanocv", "ocv", "ocvavg", "opencircuitvoltage")
_SLOW_HOURS = 1000.0
"""At C/1000 the overpotential of any cell is lost in the noise of its voltage."""

_KINDS = "fiubUO"
"""Kinds of arrays that may be columns: numbers, texts and objects."""

_VALUES = 8
"""A field with more values than this numbers the tests, and chooses none of them."""


@dataclass(frozen=True)
class _Test:
    """A struct with columns of one length."""

    path: tuple[str, ...]  # Names of the structs around it and its own; elements of struct arrays count from 1.
    columns: dict[str, NDArray[Any]]  # Shape (n,).
    fields: dict[str, str]  # Single values in it and in the structs around it.
    start: float | None = None  # When it began, in s since 1970, where a struct around it has a date vector.

    @property
    def name(self) -> str:
        return "/".join(self.path)


class MatlabOptions(BaseModel, extra="forbid", frozen=True):
    """What a file does not say."""

    capacity: float | None = Field(
        default=None, gt=0, description="Capacity in A.h; reads an open-circuit curve as a discharge at C/1000."
    )


class MatlabMat:
    """Reads structs of columns (``meas.Voltage``), at any depth, and plain variables.

    A file of several tests needs ``--sheet T25/cRate_1C`` (names on the way to the test, in order; patterns such as
    ``T25/*`` are allowed) or ``--where type=discharge`` (a field in the structs around it).
    """

    def __init__(self, options: MatlabOptions) -> None:
        self._capacity = options.capacity

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.mat``."""
        return path.suffix.lower() == ".mat" and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the one test that is meant; see `Reader.read`."""
        source = shown(path.name)
        content = load(path, source)
        everything = list(_tests(content, (), {}))
        tests = [test for test in everything if _is_record(test, options)]
        if not tests:
            tests = [_slow_discharge(test, self._capacity, source) for test in everything if _is_ocv(test)]
        if not tests:
            raise _no_test(source, everything)
        found = _chosen(tests, options, source)
        parts = [_read(test, source, options) for test in found]
        if len(parts) > 1:
            parts = [replace(part, source=test.name) for part, test in zip(parts, found, strict=True)]
        return joined(parts, source)


def _tests(
    content: Any, path: tuple[str, ...], fields: Mapping[str, str], start: float | None = None
) -> Iterator[_Test]:
    """Every struct that has columns, in the order of the file."""
    if isinstance(content, Mapping):
        start = next(filter(None, map(_date_vector, content.values())), start)
        columns = _columns(content)
        size = len(next(iter(columns.values()), ()))
        single = {name: str(value) for name, value in content.items() if _is_single(value, size)}
        inside = {**fields, **single}
        if columns:
            yield _Test(path, columns, inside, start)
        children = list(content.items())
    elif isinstance(content, Sequence | np.ndarray) and not isinstance(content, str):
        inside = dict(fields)
        children = [(str(k), child) for k, child in enumerate(content, 1)] if _holds_structs(content) else []
    else:
        return
    for name, child in children:
        yield from _tests(child, (*path, shown(name)), inside, start)


def _date_vector(value: Any) -> float | None:
    """What MATLAB's ``clock`` gives, year to second, in s since 1970."""
    if not isinstance(value, np.ndarray) or value.shape != (6,) or value.dtype.kind not in "fiu":
        return None
    try:
        year, month, day, hour, minute = (int(part) for part in value[:5])
        date = datetime(year, month, day, hour, minute, tzinfo=UTC).timestamp() + float(value[5])
    except (ValueError, OverflowError):
        return None
    return date if YEARS_S[0] < date < YEARS_S[1] else None


def _is_single(value: Any, size: int) -> bool:
    """Whether a field says one thing of a test with columns of this length: a letter for each sample is a text too."""
    letters = isinstance(value, str) and len(value) == size > 0
    return isinstance(value, str | int | float | np.number) and len(str(value)) <= 60 and not letters


def _holds_structs(content: Any) -> bool:
    return (not isinstance(content, np.ndarray) or content.dtype == object) and any(
        isinstance(child, Mapping | Sequence) and not isinstance(child, str) for child in content
    )


def _columns(struct: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """The fields of one length: that of a time and a voltage, else that of most fields, else the larger one."""
    arrays = {
        name: np.asarray(value)
        for name, value in struct.items()
        if isinstance(value, np.ndarray) and value.ndim == 1 and len(value) >= _MIN_ROWS and value.dtype.kind in _KINDS
    }
    alike: dict[int, dict[str, NDArray[Any]]] = {}
    for name, value in arrays.items():
        alike.setdefault(len(value), {})[name] = value
    usual = max(alike, key=lambda size: (_has_signals(map(signal_of, alike[size])), len(alike[size]), size), default=0)
    return alike.get(usual, {})


def _is_record(test: _Test, options: ReadOptions) -> bool:
    said = set(options.signal_columns.values())
    signals = {signal_of(name) for name in test.columns} | set(options.signal_columns)
    return said <= set(test.columns) and _has_signals(signals)


def _has_signals(signals: Iterable[Signal | None]) -> bool:
    return {"time", "voltage"} <= set(signals)


def _is_ocv(test: _Test) -> bool:
    return None not in (named(tuple(test.columns), _SOC), named(tuple(test.columns), _OCV))


def _slow_discharge(test: _Test, capacity: float | None, source: str) -> _Test:
    """An open-circuit curve as the record of a discharge so slow that it makes no difference."""
    if capacity is None:
        raise BsaError(
            f"{source} holds an open-circuit curve over the state of charge, not a record over time.",
            "say the capacity of the cell in A.h to read it as a discharge at C/1000: --reader-option capacity=5.",
        )
    names = tuple(test.columns)
    soc, ocv = (
        np.asarray(test.columns[names[place]], dtype=np.float64)
        for place in (named(names, _SOC), named(names, _OCV))
        if place is not None
    )
    order = np.argsort(-soc, kind="stable")
    share = (soc[order[0]] - soc[order]) / (100.0 if soc.max() > 1.5 else 1.0)
    columns = {
        "Time [h]": share * _SLOW_HOURS,
        "Voltage [V]": ocv[order],
        "Current [A]": np.full(len(soc), -capacity / _SLOW_HOURS),
    }
    return replace(test, columns=columns)


def _chosen(tests: Sequence[_Test], options: ReadOptions, source: str) -> list[_Test]:
    fields = {name for test in tests for name in test.fields} & set(options.where)
    found = [
        test
        for test in tests
        if (options.sheet is None or _lies_at(test, options.sheet))
        and all(same(test.fields.get(name, ""), options.where[name]) for name in fields)
    ]
    if len(found) == 1 or (found and options.join):
        return found
    if not found:
        wanted = [f'--sheet "{shown(options.sheet)}"'] * (options.sheet is not None)
        wanted += [f"--where {shown(name)}={shown(options.where[name])}" for name in sorted(fields)]
        raise BsaError(
            f"{source} has no test for {' and '.join(wanted)}.", f"it has {_overview(_nearest(tests, options.sheet))}."
        )
    raise BsaError(
        f"{source} holds {len(found)} tests" + " that fit." * (len(found) < len(tests)) + "." * (found == tests),
        f"choose one with --sheet {shown(_example(found[0], tests))}, or say --join to join them; "
        f"there are {_overview(found)}.",
    )


def _lies_at(test: _Test, pattern: str) -> bool:
    """Whether the parts of the pattern are met on the way to the test, in order."""
    steps = iter(test.path)
    return all(any(fnmatchcase(step, part) for step in steps) for part in pattern.split("/"))


def _nearest(tests: Sequence[_Test], pattern: str | None) -> Sequence[_Test]:
    """The tests that lie where the pattern leads, as far as it leads anywhere."""
    parts = (pattern or "").split("/")
    heads = ("/".join(parts[:count]) for count in range(len(parts) - 1, 0, -1))
    found = ([test for test in tests if _lies_at(test, head)] for head in heads)
    return next((near for near in found if near), tests)


def _levels(tests: Sequence[_Test]) -> list[list[str]]:
    """The names at each depth, in the order of the file."""
    depth = max(len(test.path) for test in tests)
    return [list(dict.fromkeys(test.path[k] for test in tests if k < len(test.path))) for k in range(depth)]


def _example(test: _Test, tests: Sequence[_Test]) -> str:
    """The names that tell a test from all others of the file; its whole path where fewer do not."""
    few = "/".join(name for name, level in zip(test.path, _levels(tests), strict=False) if len(level) > 1)
    return few if [one for one in tests if _lies_at(one, few)] == [test] else test.name


def _overview(tests: Sequence[_Test]) -> str:
    """The names at each depth where they differ, and the fields that differ between the tests."""
    levels = _levels(tests)
    said = " / ".join(_names(level) for level in levels if len(level) > 1) or tests[0].name
    for name in {name: None for test in tests for name in test.fields}:
        values = list(dict.fromkeys(test.fields[name] for test in tests if name in test.fields))
        if 1 < len(values) <= _VALUES:
            said += f"; --where {shown(name)}= {', '.join(shown(value, 30) for value in values)}"
    return said


def _names(level: Sequence[str]) -> str:
    if len(level) > 12:
        return f"{level[0]} ... {level[-1]} ({len(level)})"
    return ", ".join(level)


def _no_test(source: str, everything: Sequence[_Test]) -> BsaError:
    if not everything:
        return BsaError(
            f"{source} holds no columns of numbers.",
            "tables and objects of MATLAB cannot be read: save a struct of arrays (s = table2struct(t, "
            '"ToScalar", true)) with time, voltage and current.',
        )
    widest = max(everything, key=lambda test: len(test.columns))
    return BsaError(
        f"{source} holds no test with a time and a voltage; {widest.name or 'the file'} has {listed(widest.columns)}.",
        "say which column is which with --column time=NAME and --column voltage=NAME.",
    )


def _read(test: _Test, source: str, options: ReadOptions) -> Samples:
    columns = dict(test.columns)
    around = named(tuple(test.fields), AMBIENT)
    if around is not None and named(tuple(columns), AMBIENT) is None:
        name = tuple(test.fields)[around]
        columns[name] = np.full(len(next(iter(columns.values()))), test.fields[name], dtype=object)
    where = {name: value for name, value in options.where.items() if name not in test.fields}
    label = f"{source}: {test.name}" if len(test.path) > 1 else source
    table = ArrayTable(label, tuple(columns), tuple(columns.values()))
    samples = read_table(table, options.model_copy(update={"where": where, "sheet": None}))
    if test.start is not None and "date" not in samples.extra:
        date = test.start + samples.time - samples.time[0]
        samples = replace(samples, extra={**samples.extra, "date": date})
    return samples
