"""Neware ``.nda`` and ``.ndax`` files, decoded by NewareNDA."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...core.errors import BsaError
from ...core.extras import require
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .arrays import ArrayTable
from .assembly import read_table
from .source import MAX_BYTES, decoding, refuse_zip_bomb

if TYPE_CHECKING:
    import pandas

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
        elif path.stat().st_size > MAX_BYTES:
            raise BsaError(f"{source} holds more than {MAX_BYTES // 2**20} MiB.", "export the record as CSV.")
        neware = require("NewareNDA.NewareNDA", "readers", f"{source} (Neware)")
        with decoding(source, "Neware file that is understood", "export the record as CSV or xlsx from BTSDA."):
            # The cycler's own numbers of cycles are kept: `segment` counts where they do not rise.
            decode = neware.read_ndax if path.suffix.lower() == ".ndax" else neware.read_nda
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # it uses what pandas will drop, which is no matter of the user's
                columns = _columns(decode(str(path), False))
        return read_table(ArrayTable(source, tuple(columns), list(columns.values())), options)


def _columns(frame: pandas.DataFrame) -> dict[str, FloatArray]:
    import pandas

    epoch = pandas.Timestamp(0, tz="UTC")
    date: FloatArray = np.asarray(
        (pandas.to_datetime(frame["Timestamp"], utc=True) - epoch) / pandas.Timedelta(seconds=1), dtype=np.float64
    )
    steps = frame["Step"].to_numpy().astype(np.float64)
    columns = {
        "Test Time / s": _test_time(frame["Time"].to_numpy().astype(np.float64), steps, date),
        "Voltage / V": frame["Voltage"].to_numpy(),
        "Current / mA": frame["Current(mA)"].to_numpy(),
        "Unix Time / s": date,
        "Step Count / 1": steps,
        "Cycle Count / 1": frame["Cycle"].to_numpy(),
        "Charging Capacity / mAh": frame["Charge_Capacity(mAh)"].to_numpy(),
        "Discharging Capacity / mAh": frame["Discharge_Capacity(mAh)"].to_numpy(),
    }
    probe = min((str(name) for name in frame.columns if re.fullmatch(r"T\d+", str(name))), default=None)
    if probe is not None:
        columns["Temperature T1 / degC"] = frame[probe].to_numpy()
    return columns


def _test_time(step_time: FloatArray, steps: FloatArray, date: FloatArray) -> FloatArray:
    """Seconds since the start, from the seconds since the start of each step and, over pauses, the date."""
    begins = np.flatnonzero(np.diff(steps) != 0) + 1
    before = np.zeros(len(steps))
    since_last = date[begins] - date[begins - 1]
    pause = since_last - step_time[begins]
    before[begins] = step_time[begins - 1] + np.where(pause > _PAUSE_S, pause, 0.0)
    return np.asarray(np.cumsum(before) + step_time)
