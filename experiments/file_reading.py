"""How a file is read: what its header does not say, and by which reader."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field

from ..core.record import ReadOptions, Record
from ..core.spectrum import ImpedanceSpectrum


@dataclass(frozen=True)
class FileReading:
    """How a file is read."""

    options: ReadOptions = field(default_factory=ReadOptions)  # What its header does not say.
    reader: str | None = None  # The reader to use; None finds the one that fits.
    reader_options: Mapping[str, Any] = field(default_factory=dict)  # The reader's own options.

    @property
    def written(self) -> dict[str, Any]:
        """As keys of a `ReadEntry`."""
        return {"read": self.options, "reader": self.reader, "reader_options": self.reader_options}

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


class ReadEntry(BaseModel, extra="forbid"):
    """How a file is read, among the keys of an entry in a file or a journal."""

    read: ReadOptions = Field(default_factory=ReadOptions, description="What the file's header does not say.")
    reader: str | None = Field(None, description="Reader to use; left out, the one that fits.")
    reader_options: dict[str, Any] = Field(default_factory=dict, description="The reader's own options.")

    @property
    def reading(self) -> FileReading:
        """The same, to read with."""
        return FileReading(self.read, self.reader, self.reader_options)
