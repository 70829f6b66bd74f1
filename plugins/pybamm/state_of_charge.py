"""Where on its open-circuit curve a cell starts, and how much charge lies between its cut-offs."""

from __future__ import annotations

from collections.abc import Mapping

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


def equilibrium_capacity_ah(parameter_set: str, overrides: Mapping[str, float]) -> float:
    """Charge between the voltage cut-offs at zero current, A.h.

    The nominal capacity that a parameter set states is a label, up to a fifth off this.
    """
    values = load(parameter_set, overrides)
    empty, full, *_ = pybamm.lithium_ion.get_min_max_stoichiometries(values)
    negative_ah = values.evaluate(pybamm.LithiumIonParameters().n.prim.Q_init)
    return float(negative_ah * (full - empty))
