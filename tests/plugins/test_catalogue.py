"""Every built-in plugin keeps what its kind promises."""

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from bsa.core.contracts.kinds import Kind
from bsa.core.contracts.registry import installed
from bsa.plugins.readers.bdf import write
from bsa.testing import (
    EffectConformance,
    FeedbackConformance,
    MemoryConformance,
    ProposerConformance,
    ReaderConformance,
    SimulatorConformance,
    WarmUpConformance,
    sample_task,
)

HEAVY = {"bo", "qnehvi", "overlay"}
"""Two load torch and fit a Gaussian process; one draws a picture of every simulation."""


def own(kind: Kind) -> list[Any]:
    names = [listing.entry.name for listing in installed().listings(kind) if listing.own]
    return [pytest.param(name, marks=[pytest.mark.slow] if name in HEAVY else []) for name in names]


@pytest.mark.slow
class TestSimulator(SimulatorConformance):
    @pytest.fixture(params=own("simulator"))
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param


class TestFeedback(FeedbackConformance):
    @pytest.fixture(params=own("feedback"))
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param


class TestMemory(MemoryConformance):
    @pytest.fixture(params=own("memory"))
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param


class TestWarmUp(WarmUpConformance):
    @pytest.fixture(params=own("warm-up"))
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param


class TestProposer(ProposerConformance):
    @pytest.fixture(params=own("proposer"))
    def name(self, request: pytest.FixtureRequest) -> str:
        if request.param in HEAVY:
            request.getfixturevalue("few_draws")
        return request.param


RECORD = sample_task().experiments[0].target
ROWS = list(zip(RECORD.time.tolist(), RECORD.voltage.tolist(), (-RECORD.current).tolist(), strict=True))


def bdf(path: Path, suffix: str = ".csv") -> Path:
    write(RECORD, path.with_suffix(suffix))
    return path.with_suffix(suffix)


def text(path: Path, *header: str, row: str = "{},{},{}") -> Path:
    path.with_suffix(".csv").write_text("\n".join([*header, *(row.format(*values) for values in ROWS)]))
    return path.with_suffix(".csv")


def arbin(path: Path) -> Path:
    book = openpyxl.Workbook()
    sheet = book.create_sheet("Channel_1-008")
    sheet.append(["Data_Point", "Test_Time(s)", "Date_Time", "Cycle_Index", "Current(A)", "Voltage(V)"])
    for number, (time, voltage, current) in enumerate(ROWS, start=1):
        date = datetime.datetime(2010, 8, 17) + datetime.timedelta(seconds=time)
        sheet.append([number, time, date, 1, current, voltage])
    book.save(path.with_suffix(".xlsx"))
    return path.with_suffix(".xlsx")


DIGATRON = ("Step,Status,Prog Time,Voltage,Current,LogTemp001,", "[],[],[ss.xxx],[V],[A],[T1],")

FILES: dict[str, Callable[[Path], Path]] = {
    "bdf-csv": bdf,
    "bdf-parquet": lambda path: bdf(path, ".parquet"),
    "arbin-xlsx": arbin,
    "digatron-csv": lambda path: text(path, *DIGATRON, row="5,PAU,{},{},{},24.5,"),
    "generic-csv": lambda path: text(path, "Time [s],U[V],I[A]"),
}


BESIDE_THEIR_FILES = {"neware", "arbin-res", "biologic-mpr", "maccor-text", "matlab"}
"""Readers of files that a test of their own makes byte by byte, and that are held to their promise there."""

OF_SPECTRA = {"impedance-csv"}
"""Readers of what is no record over time."""


def test_no_reader_is_left_out() -> None:
    readers = {listing.entry.name for listing in installed().listings("reader") if listing.own}
    assert readers == set(FILES) | BESIDE_THEIR_FILES | OF_SPECTRA


class TestReader(ReaderConformance):
    @pytest.fixture(params=FILES)
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param

    @pytest.fixture
    def file(self, name: str, tmp_path: Path) -> Path:
        return FILES[name](tmp_path / "cell")


class TestEffect(EffectConformance):
    @pytest.fixture(params=own("effect"))
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param
