"""How many mesh points a particle needs.

The usual 40, finer towards the surface, are enough where the diffusivity varies little. Where it varies by decades, its
harmonic mean between two cells is that of the slower one, and a front is held up at every cell: O'Regan's graphite
(`ORegan2022`) at 2C is half a volt and a third of its capacity short on 20 points. No correction of a fit makes up for
that, so the mesh is settled before anything is fitted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....core.contracts.requests import MeasuredRecord
from ....core.inference.observations import after_jumps
from ....core.rms import rms
from ....core.task import CellModel
from ....core.thinning import evenly
from ....core.trajectory import FloatArray
from ..modelling.compiled_cell import Start
from ..modelling.resolution import Resolution
from ..solving.driven_cell import FINE, SEARCH, DrivenCell
from .uncertain_parameters import UNKNOWN_SOC

_USUAL = SEARCH.mesh()["r_n"]
_POINTS = (_USUAL, 2 * _USUAL, 4 * _USUAL)
_SHIFT_V = 1e-2
"""What twice as many points may change, V: less is corrected for after the base fit."""

_SAMPLES = 400
"""Samples of the record, at most, at which the voltages of two meshes are compared."""


@dataclass(frozen=True)
class RadialMesh:
    """Mesh and tolerances that resolve the particles."""

    radial_points: int  # In each particle.
    shift_v: float  # What twice the usual points change, V (root mean square); infinite if it could not be simulated.

    @property
    def usual(self) -> Resolution:
        """For a search."""
        return replace(SEARCH, radial_points=self.radial_points)

    @property
    def fine(self) -> Resolution:
        """For the check on a search, with twice as many points."""
        return replace(FINE, radial_points=2 * self.radial_points)

    @property
    def note(self) -> str:
        """In words, what was chosen; empty where the usual mesh is enough."""
        first, second = _POINTS[:2]
        if self.radial_points == first:
            return ""
        moved = f"from {first} to {second} the voltage moves by {1e3 * self.shift_v:.0f} mV"
        return f"{self.radial_points} mesh points resolve each particle: {moved}"


def radial_mesh(
    cell: CellModel, measured_records: Sequence[MeasuredRecord], soc: Mapping[str, float] | None = None
) -> RadialMesh:
    """Measure how many points the particles need.

    The record with the strongest current is driven on the base model as it is believed, with twice as many radial
    points each time until the voltage moves by less than 10 mV (root mean square). ``soc`` is, by record, its initial
    state of charge; `UNKNOWN_SOC` for those not named.
    """
    hardest = max(measured_records, key=lambda measured_record: float(np.max(np.abs(measured_record.record.current))))
    kept = evenly(len(hardest.record.time), _SAMPLES)
    times, current = after_jumps(hardest.record)[kept], hardest.record.current[kept]
    start = (soc or {}).get(hardest.name, UNKNOWN_SOC)
    temperatures = Start(temperature_k=hardest.ambient_k, initial_temperature_k=hardest.initial_k)

    def voltage(points: int) -> FloatArray | None:
        """NaN where the cell was empty or overfull."""
        resolution = replace(SEARCH, radial_points=points)
        driven = DrivenCell(cell, (), hardest.record, {}, temperatures, resolution)
        curve = driven.solve({}, times, current, start)
        return None if curve is None else np.where(driven.within_limits(curve.voltage), curve.voltage, np.nan)

    chosen, coarse = _POINTS[0], voltage(_POINTS[0])
    shifts: list[float] = []
    for finer in _POINTS[1:]:
        fine = voltage(finer)
        if coarse is None or fine is None:
            break
        both = np.isfinite(coarse) & np.isfinite(fine)
        shifts.append(rms((fine - coarse)[both]) if both.any() else np.inf)
        if shifts[-1] < _SHIFT_V:
            break
        chosen, coarse = finer, fine
    return RadialMesh(chosen, shifts[0] if shifts else np.inf)
