"""Neware files as its software lays them out, made here byte by byte."""

from __future__ import annotations

import struct
import sys
import zipfile
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.trajectory import StepKind
from bsa.plugins.readers import source
from bsa.testing import ReaderConformance

pytest.importorskip("fastnda", reason='pip install "battery-sim-agent[readers]"')

CHARGE, DISCHARGE, REST = 1, 2, 4
START = datetime(2024, 5, 1, 12, 0, 0)
PAUSE_S = 500


def rows():
    """Number, step, state, seconds in the step, volts, amperes, date; the second rest begins after a pause."""
    number, begun = 1, START
    for step, (state, amperes) in enumerate([(REST, 0.0), (DISCHARGE, -2.0), (REST, 0.0), (CHARGE, 1.0)], 1):
        begun += timedelta(seconds=PAUSE_S * (step == 3))
        for k in range(30):
            voltage = 3.8 + 0.05 * amperes + (0.004 * k * np.sign(amperes))
            yield number, step, state, 10 * k, voltage, amperes, begun + timedelta(seconds=10 * k)
            number += 1
        begun += timedelta(seconds=290)


def tail(state: int, seconds: int, voltage: float, amperes: float, date: datetime) -> tuple[bytes, ...]:
    """Time, voltage and current; charges; date; range, as in all of Neware's older records."""
    clock = struct.pack("<HBBBBB", date.year, date.month, date.day, date.hour, date.minute, date.second)
    charge = seconds * amperes * 1000 * 10
    both = (max(charge, 0.0), max(-charge, 0.0), 0.0, 0.0)
    signal = struct.pack("<Qii", 1000 * seconds, round(10000 * voltage), round(amperes * 1000 * 10))
    return signal, struct.pack("<qqqq", *map(round, both)), clock, struct.pack("<i", 1000)


def nda(path: Path) -> None:
    records = [bytes(4)]
    for number, step, state, seconds, voltage, amperes, date in rows():
        signal, charges, clock, scale = tail(state, seconds, voltage, amperes, date)
        head = b"\x55\x00" + struct.pack("<IIHB", number, 0, step, state)[:10] + struct.pack("<B", state) + b"\0"
        record = (head + signal + bytes(8) + charges + clock + b"\0" + scale).ljust(86, b"\0")
        assert len(record) == 86
        records.append(record)
    path.write_bytes(b"NEWARE".ljust(14, b"\0") + bytes([29]) + b"\1" * 85 + b"".join(records))


def ndax(path: Path) -> None:
    blocks, record = [b"\1\0\5".ljust(4096, b"\0")], []
    for number, step, state, seconds, voltage, amperes, date in rows():
        signal, charges, clock, scale = tail(state, seconds, voltage, amperes, date)
        head = bytes(7) + b"\x55" + struct.pack("<IIBB", number, 0, step, state)
        one = (head.ljust(23, b"\0") + signal + bytes(4) + charges + clock + scale).ljust(87, b"\0")
        record.append(one)
    for first in range(0, len(record), 45):
        some = record[first : first + 45]
        full = ((1 << len(some)) - 1).to_bytes(121, "little")  # a bit for each record that is there
        blocks.append(bytes(4) + full + b"".join(some).ljust(4096 - 125 - 56, b"\0") + bytes(56))
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("data.ndc", b"".join(blocks))


@pytest.mark.parametrize(("suffix", "write"), [("nda", nda), ("ndax", ndax)])
def test_steps_and_pauses_come_out_on_one_clock(tmp_path, suffix, write):
    path = tmp_path / f"a.{suffix}"
    write(path)
    record = read_record(path)
    kinds = [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST, StepKind.CC_CHARGE]
    assert [step.kind for step in record.trajectory.steps] == kinds
    assert record.trajectory.duration == pytest.approx(4 * 290 + PAUSE_S, abs=2)
    assert record.trajectory.current.max() == pytest.approx(2.0)
    assert np.all(np.diff(record.trajectory.time) >= 0)
    # No current flowed in the pause, as the counter knows and the samples do not.
    (said,) = [note for note in record.notes if "counter" in note]
    assert "after row 60); when it did is taken from the file's own counter" in said
    discharged = record.trajectory.steps[1]
    drawn = record.trajectory.discharge_capacity
    assert drawn[discharged.stop - 1] - drawn[discharged.start] == pytest.approx(2.0 * 290 / 3600, rel=0.01)


@pytest.mark.parametrize("suffix", ["nda", "ndax"])
def test_damaged_files(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"a.{suffix}"
    whole = tmp_path / "whole.ndax"
    ndax(whole)
    for content in (b"", b"hello", b"NEWARE".ljust(200, b"\0"), whole.read_bytes()[:500], zipped(tmp_path)):
        path.write_bytes(content)
        with pytest.raises(BsaError, match=rf"a\.{suffix} (is no|is not a|begins like) "):
            read_record(path)
    monkeypatch.setattr(source, "MAX_RATIO", 0)
    monkeypatch.setattr(source, "RATIO_BYTES", 0)
    whole.rename(tmp_path / "b.ndax")
    with pytest.raises(BsaError, match="times its size"):
        read_record(tmp_path / "b.ndax")


def zipped(folder: Path) -> bytes:
    with zipfile.ZipFile(folder / "x.zip", "w") as package:
        package.writestr("other.ndc", b"x")
    return (folder / "x.zip").read_bytes()


def test_without_the_library(tmp_path, monkeypatch):
    path = tmp_path / "a.nda"
    nda(path)
    monkeypatch.setitem(sys.modules, "fastnda", None)
    with pytest.raises(BsaError, match="needs fastnda") as raised:
        read_record(path)
    assert raised.value.hint == 'pip install "battery-sim-agent[readers]"'


class TestNeware(ReaderConformance):
    @pytest.fixture
    def name(self) -> str:
        return "neware"

    @pytest.fixture
    def file(self, tmp_path):
        ndax(tmp_path / "cell.ndax")
        return tmp_path / "cell.ndax"
