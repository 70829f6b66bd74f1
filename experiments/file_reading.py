"""How a file is read: what its header does not say, and by which reader."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..core.record import ReadOptions, Record
from ..core.spectrum import ImpedanceSpectrum


@dataclass(frozen=True)
class FileReading:
    """How a file is read."""

    options: ReadOptions = field(default_factory=ReadOptions)  # What its header does not say.
    reader: str | None = None  # The reader to use; None finds the one that fits.
    reader_options: Mapping[str, Any] = field(default_factory=dict)  # The reader's own options.

    def read(self, source: Path | str | Sequence[Path | str]) -> Record | ImpedanceSpectrum:
        """What a file holds, or the files of one cell together; see `read_file`."""
        from ..core.reading.reading import read_file

        return read_file(source, self.options, reader=self.reader, reader_options=self.reader_options)

    def record(self, source: Path | str | Sequence[Path | str]) -> Record:
        """The record over time that it holds; see `read_record`."""
        from ..core.reading.reading import read_record

        return read_record(source, self.options, reader=self.reader, reader_options=self.reader_options)

    def joined(self, files: Sequence[Path]) -> Path | Record:
        """A file, or what the files of one cell hold together."""
        return files[0] if len(files) == 1 else self.record(files)
