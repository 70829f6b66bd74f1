"""Neware ``.nda`` and ``.ndax`` files, decoded by fastnda."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ...core.extras import require
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .arrays import ArrayTable
from .assembly import read_table
from .source import MAX_BYTES, decoding, refuse_large, refuse_zip_bomb, silence

_PAUSE_S = 2.0
"""Dates are written to the second: a step that begins later than this after the last one began after a pause, in s."""


class Neware:
    """Reads the records of Neware's cyclers; the time of each step is carried on over the whole test."""

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.nda`` or ``.ndax``."""
        return path.suffix.lower() in (".nda", ".ndax") and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        source = shown(path.name)
        if path.suffix.lower() == ".ndax":
            refuse_zip_bomb(path, source, "a Neware .ndax file", MAX_BYTES)
        else:
            refuse_large(path.stat().st_size, source, "export the record as CSV.")
        fastnda = require("fastnda", "readers", f"{source} (Neware)")
        silence("fastnda")
        with decoding(source, "Neware file that is understood", "export the record as CSV or xlsx from BTSDA."):
            # The cycler's own numbers of cycles are kept: `segment` counts where they do not rise.
            columns = _columns(fastnda.read(path, cycle_mode="raw"))
        return read_table(ArrayTable(source, tuple(columns), list(columns.values())), options)


def _columns(frame: Any) -> dict[str, FloatArray]:
    """The columns that are read of a data frame of polars, by which fastnda gives what it decodes."""

    def values(name: str) -> FloatArray:
        return np.asarray(frame[name].to_numpy(), dtype=np.float64)

    steps, date, capacity = values("step_count"), values("unix_time_s"), values("capacity_mAh")
    columns = {
        "Test Time / s": _test_time(values("step_time_s"), steps, date),
        "Voltage / V": values("voltage_V"),
        "Current / mA": values("current_mA"),
        "Unix Time / s": date,
        "Step Count / 1": steps,
        "Cycle Count / 1": values("cycle_count"),
        # Since the start of the step, negative on discharge.
        "Charging Capacity / mAh": np.maximum(capacity, 0.0),
        "Discharging Capacity / mAh": np.maximum(-capacity, 0.0),
    }
    probe = min((name for name in frame.columns if re.fullmatch(r"aux\d*_temperature_degC", name)), default=None)
    if probe is not None:
        columns["Temperature T1 / degC"] = values(probe)
    return columns


def _test_time(step_time: FloatArray, steps: FloatArray, date: FloatArray) -> FloatArray:
    """Seconds since the start, from the seconds since the start of each step and, over pauses, the date."""
    begins = np.flatnonzero(np.diff(steps) != 0) + 1
    before = np.zeros(len(steps))
    since_last = date[begins] - date[begins - 1]
    pause = since_last - step_time[begins]
    before[begins] = step_time[begins - 1] + np.where(pause > _PAUSE_S, pause, 0.0)
    return np.asarray(np.cumsum(before) + step_time)
