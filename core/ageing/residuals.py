"""Residuals of a cycle table, so that a fit follows the fade between the cycles whose curves it compares."""

import numpy as np
from numpy.typing import NDArray

from ..thinning import evenly
from ..trajectory import FloatArray, Trajectory
from .cycle_table import CycleTable

CAPACITY_TOLERANCE = 1e-3
"""Relative, as that of a step's duration: a discharge at constant current lasts in proportion to the capacity."""

RESISTANCE_TOLERANCE = 1e-2
"""Relative: cyclers resolve a resistance to about one in a hundred."""

_LINES = 24
"""Cycles of a table that give residuals, whatever its length, so that it weighs as much for 20 as for 2,000."""


def compared_cycles(measured: CycleTable) -> NDArray[np.intp]:
    """Places of the lines of a table that give residuals."""
    return evenly(len(measured), _LINES)


def table_residuals(simulated: Trajectory | None, measured: CycleTable) -> FloatArray:
    """Mismatches of capacity and resistance in tolerances, shape (k,); NaN where the simulation has no such cycle.

    The layout depends on the measured table alone.
    """
    picks = compared_cycles(measured)
    cycles = measured.cycle[picks]
    table = None if simulated is None else simulated.cycle_table
    if table is None:
        capacity = resistance = np.full(len(cycles), np.nan)
    else:
        capacity, resistance = table.at(cycles), table.at(cycles, "resistance_ohm")
    known = np.isfinite(measured.resistance_ohm[picks])
    return np.concatenate(
        [
            (capacity / measured.capacity_ah[picks] - 1.0) / CAPACITY_TOLERANCE,
            (resistance[known] / measured.resistance_ohm[picks][known] - 1.0) / RESISTANCE_TOLERANCE,
        ]
    )
