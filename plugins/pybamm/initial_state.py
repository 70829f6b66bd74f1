"""The initial lithium content of both electrodes, from a state of charge, the hosts and the lithium between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.parameters import Candidate
from ...core.trajectory import FloatArray
from .parameter_sets import INITIAL_SOC, pybamm

CYCLABLE_LITHIUM = "Cyclable lithium factor"
"""A searchable name that PyBaMM does not know: multiplies the lithium that both electrodes share."""

_HOST = "{} electrode active material volume fraction factor"


class ElectrodeBalance:
    """Solves for the stoichiometries at a state of charge.

    With host capacities :math:`Q_n, Q_p` and cyclable lithium :math:`Q_{Li} = Q_n x + Q_p y`, the cell is full
    where :math:`U_p(y) - U_n(x) = V_{max}` and empty where it is :math:`V_{min}`; the state of charge is linear
    in between (Mohtat et al., J. Electrochem. Soc. 2019, doi:10.1149/1.5122794).

    Parameters
    ----------
    values : pybamm.ParameterValues
        The plain set, before anything is opened to the search.
    """

    def __init__(self, values: Any) -> None:
        self._capacity: dict[str, float] = {}
        self._c_max: dict[str, float] = {}
        initial: dict[str, float] = {}
        self._grid = np.linspace(1e-3, 1 - 1e-3, 2001)
        self._ocp: dict[str, FloatArray] = {}
        for which in ("Negative", "Positive"):
            c_max = _number(values, f"Maximum concentration in {which.lower()} electrode [mol.m-3]")
            self._c_max[which] = c_max
            self._capacity[which] = (
                _number(values, f"{which} electrode active material volume fraction")
                * _number(values, f"{which} electrode thickness [m]")
                * c_max
            )
            initial[which] = _number(values, f"Initial concentration in {which.lower()} electrode [mol.m-3]") / c_max
            ocp = values[f"{which} electrode OCP [V]"]
            curve = values.process_symbol(ocp(pybamm.Vector(self._grid))).evaluate()
            self._ocp[which] = np.asarray(curve, dtype=np.float64).ravel()
        self._initial = initial
        self._limits = tuple(
            _number(values, f"Open-circuit voltage at {percent}% SOC [V]", f"{side} voltage cut-off [V]")
            for percent, side in ((0, "Lower"), (100, "Upper"))
        )

    def initial_concentrations(self, candidate: Candidate) -> tuple[float, float]:
        """Initial concentrations in the negative and positive particles, mol/m3.

        Raises
        ------
        ValueError
            If the electrodes cannot reach the voltage limits with this lithium.
        """
        q_n = self._capacity["Negative"] * candidate.get(_HOST.format("Negative"), 1.0)
        q_p = self._capacity["Positive"] * candidate.get(_HOST.format("Positive"), 1.0)
        lithium = (q_n * self._initial["Negative"] + q_p * self._initial["Positive"]) * candidate.get(
            CYCLABLE_LITHIUM, 1.0
        )
        x = self._grid
        y = (lithium - q_n * x) / q_p
        possible = (y > self._grid[0]) & (y < self._grid[-1])
        if np.count_nonzero(possible) < 10:
            raise ValueError("no lithium content fits both electrodes")
        x, y = x[possible], y[possible]
        voltage = np.interp(y, self._grid, self._ocp["Positive"]) - self._ocp["Negative"][possible]
        voltage = np.maximum.accumulate(voltage)
        empty, full = (float(np.interp(limit, voltage, x)) for limit in self._limits)
        soc = candidate.get(INITIAL_SOC)
        negative = self._initial["Negative"] if soc is None else empty + soc * (full - empty)
        positive = (lithium - q_n * negative) / q_p
        if not 0 < negative < 1 or not 0 < positive < 1:
            raise ValueError(f"stoichiometries {negative:.3f} and {positive:.3f} must lie between 0 and 1")
        return negative * self._c_max["Negative"], positive * self._c_max["Positive"]


def _number(values: Any, *names: str) -> float:
    name = next((name for name in names if name in values), names[0])
    return float(values.evaluate(values[name]) if not isinstance(values[name], (int, float)) else values[name])
