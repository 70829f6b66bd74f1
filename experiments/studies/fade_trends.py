"""Fades of measured lives continued without a cell: ``python -m bsa.experiments.studies.fade_trends FOLDER``.

What the first cycles alone tell of a later capacity: a square root of the cycle number, as of SEI growth limited by
diffusion, a straight line, and both together are fitted to the capacities of CALCE's cells, and continued.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...core.files import write_csv
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from ..task_request import CellChoice, Records, task_of_records
from .whole_life import CELLS, FITTED, FORETOLD, MODEL, SET

FITTED_TO = (FITTED, 300)

LAWS: Mapping[str, tuple[Callable[[FloatArray], FloatArray], ...]] = {
    "square root": (np.sqrt,),
    "line": (np.asarray,),
    "both": (np.sqrt, np.asarray),
}
"""What the capacity that is lost is a sum of, by the name of the law."""


@dataclass(frozen=True)
class Trend:
    """A law of the cycle number, fitted to the first cycles of a life."""

    cell: str
    law: str
    fitted_to: int  # The last cycle of the fit.
    rms_pct: float  # What it leaves of the fitted capacities, in percent of the first one.
    cycle: int
    off_pct: float  # Continued minus measured capacity of that cycle, in percent of the measured one.


def continued(cycle: FloatArray, capacity_ah: FloatArray, law: str, fitted_to: int) -> tuple[FloatArray, float]:
    """The capacities of all cycles by a law fitted to the first, A.h, and the root mean square of what it leaves, A.h.

    ``cycle`` and ``capacity_ah``, of shape (n,), are what was measured; ``law`` is one of `LAWS`, and ``fitted_to`` the
    last cycle of the fit.
    """
    columns = np.column_stack([np.ones(len(cycle)), *(part(cycle) for part in LAWS[law])])
    early = cycle <= fitted_to
    coefficients, *_ = np.linalg.lstsq(columns[early], capacity_ah[early], rcond=None)
    whole = columns @ coefficients
    return whole, float(np.sqrt(np.mean((whole - capacity_ah)[early] ** 2)))


def trends_of(cell: str, cycle: FloatArray, capacity_ah: FloatArray) -> Iterator[Trend]:
    """Every law, from every last cycle of the fit, at the last cycle of a life."""
    for fitted_to in FITTED_TO:
        for law in LAWS:
            whole, left = continued(cycle, capacity_ah, law, fitted_to)
            off = whole[-1] / capacity_ah[-1] - 1.0
            yield Trend(cell, law, fitted_to, 100.0 * left / capacity_ah[0], int(cycle[-1]), 100.0 * off)


def _capacities(data: Path) -> tuple[FloatArray, FloatArray]:
    """Cycles and capacities, as ``bsa-run --life`` reads them."""
    records = Records([data], reads=[ReadOptions(cycles=(1, FORETOLD))], fit_cycles=FITTED)
    task = task_of_records(records, CellChoice(SET, MODEL))
    tables = [e.target.cycle_table for e in (*task.experiments, *task.held_out)]
    known = [table for table in tables if table is not None]
    return np.concatenate([table.cycle for table in known]), np.concatenate([table.capacity_ah for table in known])


if __name__ == "__main__":
    lives = {cell: _capacities(Path(sys.argv[1]) / f"{cell}_all.csv.gz") for cell in CELLS}
    found = [asdict(trend) for cell, life in lives.items() for trend in trends_of(cell, *life)]
    write_csv(Path("fade_trends.csv"), found)
