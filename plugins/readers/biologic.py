"""BioLogic ``.mpr`` files, records and impedance spectra, decoded by galvani."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core.extras import require
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.spectrum import ImpedanceSpectrum
from ...core.trajectory import SECONDS_PER_HOUR, FloatArray
from .arrays import ArrayTable
from .assembly import read_table
from .columns import signal_of
from .impedance import spectrum_of
from .impedance_columns import is_of_a_record, spectrum_columns
from .source import decoding, refuse_large

_TIME = "time/s"
_CHARGE, _CHARGE_SINCE = "(Q-Qo)/mA.h", ("dq/mA.h", "dQ/mA.h")
"""Charge since the start of the technique, and since the sample before."""

_CONTROL = ("control/V/mA", "control/mA")
"""What the instrument was set to: a current (mA) in a galvanostatic step."""

_GALVANOSTATIC, _REST = 1, 3
"""Modes, as the flags of each sample have them."""


class BioLogicMpr:
    """Reads what EC-Lab and BT-Lab save; a file whose rows have frequencies and impedances is a spectrum.

    Galvanostatic cycling is saved without a current, which EC-Lab works out where it shows or exports the file; it is
    worked out here in the same way.
    """

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.mpr``."""
        return path.suffix.lower() == ".mpr" and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples | ImpedanceSpectrum:
        """Read the file; see `Reader.read`."""
        source = shown(path.name)
        refuse_large(path.stat().st_size, source, "export the record as text (.mpt).")
        galvani = require("galvani", "biologic", f"{source} (BioLogic)")
        with decoding(source, "BioLogic file that is understood", "export it as text (.mpt) from EC-Lab."):
            file = galvani.BioLogic.MPRfile(str(path))
            columns = {name: np.asarray(file.data[name], dtype=np.float64) for name in file.data.dtype.names}
            if _TIME in columns and hasattr(file, "timestamp"):
                start = np.datetime64(file.timestamp).astype("datetime64[ms]").astype(np.float64) / 1e3
                columns["Unix Time / s"] = start + columns[_TIME]
            current, notes = _current(file, columns), []
            if current is not None:
                columns["<I>/mA"] = current
                notes = [
                    "the file holds no current: galvanostatic steps have the current that was set, and other samples "
                    "that of the charge since the sample before."
                ]
        table = ArrayTable(source, tuple(columns), list(columns.values()))
        impedance = spectrum_columns(table.header, {})
        if impedance is None or is_of_a_record(table.header, table.columns[impedance.frequency]):
            return read_table(table, options, notes)
        return spectrum_of(table, options)


def _current(file: Any, columns: Mapping[str, FloatArray]) -> FloatArray | None:
    """The current of each sample, mA, of a file that holds none; None where one is held, or nothing tells it."""
    if _TIME not in columns or "flags" not in columns or any(signal_of(name) == "current" for name in columns):
        return None
    mode = np.asarray(file.get_flag("mode"))
    charge = columns.get(_CHARGE)
    since = next((columns[name] for name in _CHARGE_SINCE if name in columns), None)
    if charge is None and since is not None:
        charge = np.cumsum(since)
    if charge is None and not np.all(mode == _REST):
        return None
    current = np.zeros(len(mode)) if charge is None else _mean_current(columns[_TIME], charge)
    control = next((columns[name] for name in _CONTROL if name in columns), current)
    return np.select([mode == _GALVANOSTATIC, mode == _REST], [control, 0.0], current)


def _mean_current(time: FloatArray, charge: FloatArray) -> FloatArray:
    """Charge (mA.h) over time (s) since the sample before, mA.

    At the first sample, and where no time passed, the current is that of the next one.
    """
    passed = np.flatnonzero(np.diff(time) > 0)
    if len(passed) == 0:
        return np.zeros(len(time))
    rate = SECONDS_PER_HOUR * np.diff(charge)[passed] / np.diff(time)[passed]
    # The first interval with a duration that ends at the sample or after it; behind the last one, that one.
    after = np.searchsorted(passed + 1, np.arange(len(time)))
    return np.asarray(rate[np.minimum(after, len(rate) - 1)])
