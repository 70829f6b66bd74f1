"""Where on its open-circuit curve a cell starts."""

from __future__ import annotations

from ...core.task import CellModel
from .parameter_sets import load, pybamm


def soc_at_voltage(cell: CellModel, voltage: float) -> float:
    """The state of charge at which the cell's open-circuit voltage is ``voltage``, kept within 0 to 1.

    Found from the electrode stoichiometry limits of the cell (PyBaMM's electrode state-of-health model)
    between its voltage cut-offs.

    Parameters
    ----------
    cell : CellModel
        The cell; only its parameter values matter.
    voltage : float
        Open-circuit voltage, V.
    """
    values = load(cell.parameter_set, cell.overrides)
    lowest, highest = float(values["Lower voltage cut-off [V]"]), float(values["Upper voltage cut-off [V]"])
    if voltage <= lowest:
        return 0.0
    if voltage >= highest:
        return 1.0
    empty, full, *_ = pybamm.lithium_ion.get_min_max_stoichiometries(values)
    x, _ = pybamm.lithium_ion.get_initial_stoichiometries(f"{voltage} V", values)[:2]
    return min(max(float((x - empty) / (full - empty)), 0.0), 1.0)
