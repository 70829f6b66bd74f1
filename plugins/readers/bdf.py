"""Battery Data Format (https://battery-data-alliance.github.io/battery-data-format), read and written."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.constants import zero_Celsius

from ...core.errors import BsaError
from ...core.extras import require
from ...core.files import replacing, write_text
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions, Record
from ...core.trajectory import SECONDS_PER_HOUR, FloatArray, Trajectory, drawn_between
from .arrays import ArrayTable
from .assembly import read_table
from .generic_csv import GenericCsv
from .source import decoding, first_lines, is_text_table, refuse_large

_LABELS = re.compile(r"^(test time|voltage|current) / \S+$")
_MACHINE = re.compile(r"^(test_time_(second|hour|minute)|voltage_(milli)?volt|current_(milli)?ampere)$")


class BdfCsv(GenericCsv):
    """Reads Battery Data Format: ``Test Time / s``, ``Voltage / V``, ``Current / A`` (positive on charge)."""

    def matches(self, path: Path) -> bool:
        """Whether the first line names the three columns that the format requires."""
        if not is_text_table(path):
            return False
        names = [
            name.strip().strip('"').casefold() for line in first_lines(path, 1) for name in re.split("[,;\t]", line)
        ]
        return sum(bool(_LABELS.match(name) or _MACHINE.match(name)) for name in names) >= 3


class BdfParquet:
    """Reads Battery Data Format from a Parquet file, or any table with a time, a voltage and a current."""

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.parquet``."""
        return path.suffix.lower() == ".parquet" and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        source = shown(path.name)
        parquet = require("pyarrow.parquet", "readers", f"{source} (Parquet)")
        with decoding(source, "Parquet file", "write it again."), parquet.ParquetFile(path) as file:
            groups = (file.metadata.row_group(k) for k in range(file.metadata.num_row_groups))
            refuse_large(sum(group.total_byte_size for group in groups), source, "write fewer columns.")
            table = file.read()
            header = tuple(str(name) for name in table.column_names)
            columns = [column.to_numpy() for column in table.columns]
        if not header:
            raise BsaError(f"{source} has no columns.", "write it again.")
        return read_table(ArrayTable(source, header, columns), options)


def write(data: Record | Trajectory, path: Path, steps: bool = True) -> None:
    """Write Battery Data Format; time, voltage and current come back exactly as they are.

    The current of the record or trajectory is turned positive on charge. ``.parquet`` is written as Parquet, anything
    else as text; ``steps`` adds the numbers of cycles and steps, where they are known. Samples that no instrument took
    (`Trajectory.inserted`) are not written, but counters of charge, from which they are found when the file is read.
    Raises `BsaError` if the file cannot be written.
    """
    trajectory = data.trajectory if isinstance(data, Record) else data
    ambient_k = data.ambient_k if isinstance(data, Record) else None
    columns = {
        "Test Time / s": trajectory.time,
        "Voltage / V": trajectory.voltage,
        # `+ 0.0` turns the -0.0 of a rest into 0.0.
        "Current / A": -trajectory.current + 0.0,
    }
    if trajectory.temperature is not None:
        columns["Temperature T1 / degC"] = np.round(trajectory.temperature - zero_Celsius, 9)
    if ambient_k is not None:
        columns["Ambient Temperature / degC"] = np.full(len(trajectory), round(ambient_k - zero_Celsius, 9))
    if steps and trajectory.steps:
        lengths = [step.stop - step.start for step in trajectory.steps]
        columns["Cycle Count / 1"] = np.repeat([float(step.cycle) for step in trajectory.steps], lengths)
        columns["Step Count / 1"] = np.repeat(np.arange(1.0, len(lengths) + 1), lengths)
    if np.any(trajectory.inserted):
        columns |= _counters(trajectory)
        measured = ~trajectory.inserted
        measured[[0, -1]] = True  # with its ends, whatever they are, the record keeps its length
        columns = {name: values[measured] for name, values in columns.items()}
    if path.suffix.lower() == ".parquet":
        _write_parquet(columns, path)
        return
    lines = [",".join(columns)]
    lines.extend(
        ",".join(map(repr, row)) for row in zip(*(values.tolist() for values in columns.values()), strict=True)
    )
    write_text(path, "\n".join(lines) + "\n")


def _counters(trajectory: Trajectory) -> dict[str, FloatArray]:
    """The charge that passed in either direction, A.h: with it, a current is known between its samples too."""
    drawn = drawn_between(trajectory.time, trajectory.current) / SECONDS_PER_HOUR
    return {
        name: np.concatenate([[0.0], np.cumsum(np.maximum(passed, 0.0))])
        for name, passed in (("Charging Capacity / Ah", -drawn), ("Discharging Capacity / Ah", drawn))
    }


def _write_parquet(columns: Mapping[str, FloatArray], path: Path) -> None:
    pyarrow = require("pyarrow", "readers", "writing Parquet")
    parquet = require("pyarrow.parquet", "readers", "writing Parquet")
    with replacing(path) as file:
        parquet.write_table(pyarrow.table(dict(columns)), file)
