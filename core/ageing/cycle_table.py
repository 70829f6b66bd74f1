"""How a cell changes over its life, in a few numbers for each cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BsaError

FloatArray = NDArray[np.float64]

MEASURED = ("capacity_ah", "resistance_ohm", "rested_voltage_v")
LOSSES = ("lithium_lost_pct", "negative_material_lost_pct", "positive_material_lost_pct")
COLUMNS = (*MEASURED, *LOSSES)


@dataclass(frozen=True, eq=False)
class CycleTable:
    """One line for each cycle."""

    cycle: FloatArray  # Cycle numbers from 1, rising; cycles that were cut short are left out. Shape (n,).
    capacity_ah: FloatArray  # Charge drawn in the discharge, A.h. Shape (n,).
    # Voltage drop over current at the start of the discharge, ohm; NaN where it is not known. Shape (n,).
    resistance_ohm: FloatArray
    # Voltage at the end of the charge, after the rest that follows it, V; NaN where it is not known. Shape (n,).
    rested_voltage_v: FloatArray
    # Cyclable lithium lost since the start, in percent; known of simulations alone, NaN elsewhere. Shape (n,).
    lithium_lost_pct: FloatArray | None = None
    # negative_material_lost_pct, positive_material_lost_pct: Active material lost in each electrode, likewise. Shape
    # (n,).
    negative_material_lost_pct: FloatArray | None = None
    positive_material_lost_pct: FloatArray | None = None

    def __post_init__(self) -> None:
        for name in LOSSES:
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(np.shape(self.cycle), np.nan))
        for name in ("cycle", *COLUMNS):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
            if getattr(self, name).shape != self.cycle.shape or self.cycle.ndim != 1:
                raise BsaError(
                    f"{name} has shape {getattr(self, name).shape}, but cycle has shape {self.cycle.shape}.",
                    "all columns of a cycle table have one value for each cycle.",
                )
        if len(self.cycle) == 0 or not np.all(np.isfinite(self.cycle)) or np.any(np.diff(self.cycle) <= 0):
            raise BsaError("the cycles of a cycle table must rise.", "sort the table by cycle, one line for each.")
        if not np.all(np.isfinite(self.capacity_ah)) or self.capacity_ah[0] <= 0:
            raise BsaError("a cycle table has a cycle without a capacity.", "leave out cycles that were cut short.")

    def __len__(self) -> int:
        return len(self.cycle)

    def at(self, cycles: FloatArray, column: str = "capacity_ah") -> FloatArray:
        """A column at other cycles, linear between the known ones; NaN outside them and where nothing is known."""
        known = np.isfinite(getattr(self, column))
        if not np.any(known):
            return np.full(np.shape(cycles), np.nan)
        found = np.interp(cycles, self.cycle[known], getattr(self, column)[known], left=np.nan, right=np.nan)
        return np.asarray(found, dtype=np.float64)

    def delivered_ah(self, cycles: FloatArray) -> FloatArray:
        """Capacity at cycles of a life that was simulated to its end, A.h.

        0 before the first line and behind the last one: the cell had no discharge there.
        """
        return np.nan_to_num(self.at(cycles), nan=0.0)

    def up_to(self, cycle: float) -> CycleTable | None:
        """The lines up to a cycle; None if there is none, as of a first cycle without a discharge."""
        kept = self.cycle <= cycle
        return self.lines(kept) if np.any(kept) else None

    def lines(self, kept: NDArray[np.bool_]) -> CycleTable:
        """Some of the lines."""
        return CycleTable(*(getattr(self, name)[kept] for name in ("cycle", *COLUMNS)))
