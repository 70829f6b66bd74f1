"""What a reader promises."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ..core.contracts.registry import installed
from ..core.errors import BsaError
from ..core.reading.reading import read_record
from ..core.record import Reader, ReadOptions, Record
from .entry import EntryConformance


class ReaderConformance(EntryConformance):
    """Tests of a reader; a subclass gives the fixtures ``name`` and ``file``."""

    kind = "reader"

    @pytest.fixture
    def file(self) -> Path:
        """A file as the cycler writes it."""
        pytest.fail(f"{type(self).__name__} lacks the fixture `file`")

    @pytest.fixture
    def read_options(self) -> ReadOptions:
        """What its header does not say."""
        return ReadOptions()

    @pytest.fixture
    def reader(self, name: str, options: dict[str, Any]) -> Reader:
        """The reader."""
        made = installed().make("reader", name, options)
        assert isinstance(made, Reader)
        return made

    def read(self, file: Path, read_options: ReadOptions, name: str, options: dict[str, Any]) -> Record:
        """The record of a file, checked as every record is."""
        return read_record(file, read_options, reader=name, reader_options=options)

    def test_it_knows_its_file(self, reader: Reader, file: Path) -> None:
        """By its name and its first bytes."""
        assert reader.matches(file) is True

    def test_a_strange_file_is_not_its_own(self, reader: Reader, file: Path, tmp_path: Path) -> None:
        """False, rather than an error, for a folder, a file that is not there and one of noise."""
        (tmp_path / "noise.bin").write_bytes(np.random.default_rng(1).bytes(4096))
        (tmp_path / "empty").mkdir()
        for strange in ("noise.bin", "empty", "not there"):
            assert reader.matches(tmp_path / strange) is False, strange
        (tmp_path / f"noise{file.suffix}").write_bytes(np.random.default_rng(1).bytes(4096))
        assert reader.matches(tmp_path / f"noise{file.suffix}") in (True, False)

    def test_the_record_is_the_same_each_time(
        self, file: Path, read_options: ReadOptions, name: str, options: dict[str, Any]
    ) -> None:
        """Steps of samples in SI units, and a file that nobody has written to."""
        before = _content(file)
        first, second = (self.read(file, read_options, name, options) for _ in range(2))
        assert first.trajectory.steps == second.trajectory.steps != ()
        assert first.notes == second.notes
        for signal, values in first.trajectory.signals.items():
            assert np.array_equal(values, second.trajectory.values(signal))
        assert _content(file) == before

    @pytest.mark.parametrize("damage", ["empty", "noise", "cut"])
    def test_a_damaged_file_is_told(
        self, file: Path, read_options: ReadOptions, name: str, options: dict[str, Any], tmp_path: Path, damage: str
    ) -> None:
        """A `BsaError` that names the file; what is left of a file that was cut may be a record."""
        content = file.read_bytes() if file.is_file() else b""
        damaged = {"empty": b"", "noise": np.random.default_rng(1).bytes(4096), "cut": content[: len(content) // 2]}
        path = tmp_path / f"damaged{file.suffix}"
        path.write_bytes(damaged[damage])
        try:
            self.read(path, read_options, name, options)
        except BsaError as error:
            assert path.name in error.message
            assert "tell its authors" not in error.hint, error
        else:
            assert damage == "cut"


def _content(path: Path) -> bytes:
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return b"".join(file.read_bytes() for file in files if file.is_file())
