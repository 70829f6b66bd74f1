"""Battery Data Format as CSV (https://battery-data-alliance.github.io/battery-data-format): read and write."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...core.errors import BsaError
from ...core.files import write_text
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions, Record
from ...core.trajectory import Trajectory
from .generic_csv import first_lines, is_text_table, read_text_table

_LABELS = re.compile(r"^(test time|voltage|current) / \S+$")
_MACHINE = re.compile(r"^(test_time_(second|hour|minute)|voltage_(milli)?volt|current_(milli)?ampere)$")


class BdfCsv:
    """Reads Battery Data Format: ``Test Time / s``, ``Voltage / V``, ``Current / A`` (positive on charge)."""

    def matches(self, path: Path) -> bool:
        """Whether the first line names the three columns that the format requires."""
        if not is_text_table(path):
            return False
        names = [
            name.strip().strip('"').casefold() for line in first_lines(path, 1) for name in re.split("[,;\t]", line)
        ]
        return sum(bool(_LABELS.match(name) or _MACHINE.match(name)) for name in names) >= 3

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        return read_text_table(path, options)


def write(data: Record | Trajectory, path: Path) -> None:
    """Write Battery Data Format; time, voltage and current come back exactly as they are.

    Parameters
    ----------
    data : Record or Trajectory
        What to write; the current is turned positive on charge.
    path : Path
        The file to write.

    Raises
    ------
    BsaError
        If the file cannot be written.
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
        columns["Temperature T1 / degC"] = np.round(trajectory.temperature - 273.15, 9)
    if ambient_k is not None:
        columns["Ambient Temperature / degC"] = np.full(len(trajectory), round(ambient_k - 273.15, 9))
    lines = [",".join(columns)]
    lines.extend(
        ",".join(map(repr, row)) for row in zip(*(values.tolist() for values in columns.values()), strict=True)
    )
    try:
        write_text(path, "\n".join(lines) + "\n")
    except OSError as error:
        raise BsaError(f"{shown(path)} cannot be written: {shown(error.strerror)}.", "choose another place.") from None
