"""Arbin ``.res`` files as its software lays them out, made here byte by byte."""

from __future__ import annotations

import struct
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from bsa.testing import ReaderConformance

pytest.importorskip("access_parser", reason='pip install "battery-sim-agent[readers]"')

N = 90
TIME = 10.0 * np.arange(N)
AMPERES = np.where((TIME >= 200) & (TIME < 700), -1.5, 0.0)
VOLTS = 3.9 + 0.05 * AMPERES + 0.3 * np.cumsum(AMPERES) * 10 / 3600
START_DAY = 45131.5  # in days since 30 December 1899

PAGE = 4096
INTEGER, DOUBLE, TEXT = 4, 7, 10
FORMATS = {INTEGER: "<i", DOUBLE: "<d"}

Table = Mapping[str, Sequence[float | str]]


def definition(columns: Mapping[str, int]) -> bytes:
    """The page that defines a table of Jet 4: columns of a fixed length, and at most one text."""
    texts = sum(kind == TEXT for kind in columns.values())
    head = struct.pack("<2sHI", b"\2\1", 0, 0) + struct.pack("<8I", 0, 0, 0, 0, 0, 0, 0, 0)
    head += struct.pack("<BHHHIIII", 0x4E, len(columns), texts, len(columns), 0, 0, 0, 0)
    rows, names, place = b"", b"", 0
    for number, (name, kind) in enumerate(columns.items()):
        size = struct.calcsize(FORMATS[kind]) if kind in FORMATS else 0
        flags = 0b11 if size else 0b10
        rows += struct.pack("<BIHHH4sHIHH", kind, 0, number, 0, number, bytes(4), flags, 0, place, size)
        names += struct.pack("<H", 2 * len(name)) + name.encode("utf-16-le")
        place += size
    return (head + rows + names).ljust(PAGE, b"\0")


def record(columns: Mapping[str, int], values: Sequence[float | str]) -> bytes:
    """One row: the fixed columns, the text with where it begins and ends, and which columns are not null."""
    row, text = struct.pack("<h", len(columns)), b""
    for kind, value in zip(columns.values(), values, strict=True):
        if isinstance(value, str):
            text = value.encode("utf-16-le")
        else:
            row += struct.pack(FORMATS[kind], value)
    if TEXT in columns.values():
        row += text + struct.pack("<3H", len(row) + len(text), len(row), 1)
    return row + b"\xff" * ((len(columns) + 7) // 8)


def pages(owner: int, columns: Mapping[str, int], table: Table) -> list[bytes]:
    """The pages with the rows of a table, which fill each of them from its end."""
    found, rows = [], [record(columns, values) for values in zip(*table.values(), strict=True)]
    share = max(1, (PAGE - 64) // (max(map(len, rows), default=1) + 2))
    for some in (rows[k : k + share] for k in range(0, len(rows), share)):
        places = PAGE - np.cumsum([len(row) for row in some])
        head = struct.pack("<2sHIIH", b"\1\1", 0, owner, 0, len(some)) + struct.pack(f"<{len(some)}H", *places)
        found.append(head.ljust(PAGE - sum(map(len, some)), b"\0") + b"".join(reversed(some)))
    return found


def res(path: Path, tables: Mapping[str, Table]) -> Path:
    """An Access database: its header, the catalogue on page 2, and a definition and the rows of each table."""
    catalogue = {"Id": INTEGER, "Type": INTEGER, "Flags": INTEGER, "Name": TEXT}
    first = 3
    ids = range(first, first + len(tables))
    names: Table = {"Id": [2, *ids], "Type": [1] * (1 + len(ids)), "Flags": [0] * (1 + len(ids))}
    names = {**names, "Name": ["MSysObjects", *tables]}
    book = [b"\0\1\0\0Standard Jet DB\0\1".ljust(PAGE, b"\0"), bytes(PAGE), definition(catalogue)]
    kinds = [{name: INTEGER if name in WHOLE else DOUBLE for name in table} for table in tables.values()]
    book += map(definition, kinds)
    book += pages(2, catalogue, names)
    for owner, kind, table in zip(ids, kinds, tables.values(), strict=True):
        book += pages(owner, kind, table)
    path.write_bytes(b"".join(book))
    return path


WHOLE = ("Test_ID", "Data_Point", "Step_Index", "Cycle_Index", "Auxiliary_Index", "Data_Type")


def samples(*tests: int) -> dict[str, list[float]]:
    """The samples of tests, the last one first, as the pages of a database may hold them."""
    found: dict[str, list[float]] = {}
    for test in tests:
        columns = {
            "Test_ID": [test] * N,
            "Data_Point": list(range(1, N + 1)),
            "Test_Time": TIME.tolist(),
            "DateTime": (START_DAY + test + TIME / 86400).tolist(),
            "Step_Index": [1 + int(a != 0) + 2 * int(t >= 700) for t, a in zip(TIME, AMPERES, strict=True)],
            "Cycle_Index": [1] * N,
            "Current": AMPERES.tolist(),
            "Voltage": VOLTS.tolist(),
        }
        found = {name: values[::-1] + found.get(name, []) for name, values in columns.items()}
    return found


def auxiliary() -> dict[str, list[float]]:
    """A voltage and two temperatures; the first temperature lacks its last reading."""
    rows = [(1, point, 0, 0, 3.3) for point in range(1, N + 1)]
    rows += [(1, point, 1, 1, 40.0) for point in range(1, N + 1)]
    rows += [(1, point, 0, 1, 25.0 + 0.01 * point) for point in range(1, N)]
    names = ("Test_ID", "Data_Point", "Auxiliary_Index", "Data_Type", "X")
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def test_samples_are_put_in_order(tmp_path):
    found = read_record(res(tmp_path / "cell.res", {"Channel_Normal_Table": samples(1)})).trajectory
    assert [step.kind for step in found.steps] == [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST]
    np.testing.assert_allclose(found.voltage, VOLTS)
    np.testing.assert_allclose(found.current, -AMPERES)
    assert found.temperature is None


def test_the_first_temperature_is_read(tmp_path):
    tables = {"Channel_Normal_Table": samples(1), "Auxiliary_Table": auxiliary()}
    temperature = read_record(res(tmp_path / "cell.res", tables)).trajectory.temperature
    np.testing.assert_allclose(temperature[:-1], 298.15 + 0.01 * np.arange(1, N))


def test_several_tests_are_joined_by_their_dates(tmp_path):
    path = res(tmp_path / "cell.res", {"Channel_Normal_Table": samples(1, 2)})
    joined = read_record(path).trajectory
    assert joined.time[len(joined) - N] - joined.time[0] == pytest.approx(86400.0)
    one = read_record(path, options=ReadOptions(where={"Test_ID": "2.0"})).trajectory
    assert len(one) == N


def test_a_database_of_another_program(tmp_path):
    with pytest.raises(BsaError, match=r"cell\.res is no Arbin file"):
        read_record(res(tmp_path / "cell.res", {"Customers": {"Data_Point": [1]}}))


def test_a_database_without_samples(tmp_path):
    empty: Table = {name: [] for name in samples(1)}
    with pytest.raises(BsaError, match=r"cell\.res holds no samples"):
        read_record(res(tmp_path / "cell.res", {"Channel_Normal_Table": empty}))


@pytest.mark.parametrize("content", [b"", b"hello" * 2000, b"\0\1\0\0Standard Jet DB\0".ljust(PAGE, b"\0")])
def test_damaged_files(tmp_path, content):
    path = tmp_path / "a.res"
    path.write_bytes(content)
    with pytest.raises(BsaError, match=r"a\.res is no Arbin file"):
        read_record(path)


def test_without_the_library(tmp_path, monkeypatch):
    path = res(tmp_path / "cell.res", {"Channel_Normal_Table": samples(1)})
    monkeypatch.setitem(sys.modules, "access_parser", None)
    with pytest.raises(BsaError, match="needs access_parser") as raised:
        read_record(path)
    assert raised.value.hint == 'pip install "battery-sim-agent[readers]"'


class TestArbinRes(ReaderConformance):
    @pytest.fixture
    def name(self) -> str:
        return "arbin-res"

    @pytest.fixture
    def file(self, tmp_path):
        return res(tmp_path / "cell.res", {"Channel_Normal_Table": samples(1)})
