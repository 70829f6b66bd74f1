"""Arbin ``.res`` files, which are Access databases, decoded by access-parser."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import day

from ...core.errors import BsaError
from ...core.extras import require
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .arrays import ArrayTable
from .assembly import read_table
from .source import decoding, refuse_large, silence

_SAMPLES, _AUXILIARY = "Channel_Normal_Table", "Auxiliary_Table"
"""Tables of the samples, and of what further inputs measured at them."""

_NAMES = {
    "Test_Time": "Test_Time(s)",
    "Voltage": "Voltage(V)",
    "Current": "Current(A)",
    "Step_Index": "Step_Index",
    "Cycle_Index": "Cycle_Index",
    "Charge_Capacity": "Charge_Capacity(Ah)",
    "Discharge_Capacity": "Discharge_Capacity(Ah)",
    "Test_ID": "Test_ID",
}
"""Columns that are read, and their names in Arbin's workbooks, which say the units."""

_TEMPERATURE = 1
"""``Data_Type`` of an auxiliary input that is a temperature."""

_DAYS_TO_1970 = 25569.0
"""Days from 30 December 1899, where an Access database begins to count, to 1970."""


class ArbinRes:
    """Reads the samples of Arbin's MITS Pro databases: time, voltage, current, step, cycle, and one temperature.

    Where several inputs are temperatures, the one with the lowest number is read. Several tests are joined by their
    dates; ``--where Test_ID=NUMBER`` chooses one.
    """

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.res``."""
        return path.suffix.lower() == ".res" and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        source = shown(path.name)
        refuse_large(path.stat().st_size, source, "export the record as CSV or .xlsx.")
        parser = require("access_parser", "readers", f"{source} (Arbin)")
        silence("access_parser")
        with decoding(source, "Arbin file that is understood", "export it as CSV or .xlsx from Arbin's Data Watcher."):
            database = parser.AccessParser(str(path))
            table = database.parse_table(_SAMPLES)
            if not table["Data_Point"]:
                raise BsaError(f"{source} holds no samples.", "export the test again.")
            samples = _arrays(table)
            order = np.lexsort((samples["Data_Point"], samples["Test_ID"]))
            columns = {title: samples[name][order] for name, title in _NAMES.items() if name in samples}
            columns["Unix Time / s"] = day * (samples["DateTime"][order] - _DAYS_TO_1970)
            inputs = _arrays(database.parse_table(_AUXILIARY)) if _AUXILIARY in database.catalog else {}
            columns |= _temperature(samples, order, inputs)
        return read_table(ArrayTable(source, tuple(columns), list(columns.values())), options)


def _arrays(table: Mapping[str, list[Any]]) -> dict[str, FloatArray]:
    """The columns of a table that hold numbers alone."""
    found = {}
    for name, cells in table.items():
        with suppress(TypeError, ValueError):
            found[name] = np.array(cells, dtype=np.float64)
    return found


def _temperature(
    samples: Mapping[str, FloatArray], order: NDArray[np.intp], inputs: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """The first auxiliary temperature, at each sample in the order wanted; nothing where none was measured."""
    if "X" not in inputs or not len(inputs["X"]):
        return {}
    thermal = inputs["Data_Type"] == _TEMPERATURE
    if not thermal.any():
        return {}
    first = thermal & (inputs["Auxiliary_Index"] == inputs["Auxiliary_Index"][thermal].min())
    keys = zip(inputs["Test_ID"][first], inputs["Data_Point"][first], strict=True)
    known = dict(zip(keys, inputs["X"][first], strict=True))
    wanted = zip(samples["Test_ID"][order], samples["Data_Point"][order], strict=True)
    return {"Aux_Temperature_1(C)": np.array([known.get(key, np.nan) for key in wanted])}
