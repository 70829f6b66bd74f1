"""Where on its open-circuit curve a cell starts, and how much charge lies between its cut-offs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....core.target import CellChange
from ....core.task import CellModel, ParameterSource
from ....core.trajectory import FloatArray
from .ocp_shape import ELECTRODES, GRID, OcpCurves
from .parameter_sets import CUT_OFFS, bake, load, pybamm


def socs_at_voltages(cell: CellModel, voltages: Sequence[float], temperature_k: float | None = None) -> list[float]:
    """The states of charge at which the cell's open-circuit voltage is each of the voltages, kept within 0 to 1.

    Those of `InitialState`, from which simulations start; only the cell's parameter values matter. The voltages are
    those at a temperature, left out at the set's initial one.
    """
    values = load(cell.parameter_set, cell.overrides)
    if temperature_k is not None:
        values.update({"Initial temperature [K]": temperature_k})
    state = InitialState(values)
    return [min(max(state.soc_at(voltage), 0.0), 1.0) for voltage in voltages]


def equilibrium_capacity_ah(parameter_set: ParameterSource, overrides: Mapping[str, float]) -> float:
    """Charge between the voltage cut-offs at zero current, A.h.

    The nominal capacity that a parameter set states is a label, up to a fifth off this.
    """
    values = load(parameter_set, overrides)
    negative_ah = values.evaluate(pybamm.LithiumIonParameters().n.prim.Q_init)
    return float(negative_ah) * InitialState(values).span


def maximum_concentration(which: str) -> str:
    """PyBaMM's name for the lithium concentration that an electrode can hold."""
    return f"Maximum concentration in {which.lower()} electrode [mol.m-3]"


def initial_concentration(which: str) -> str:
    """PyBaMM's name for the lithium concentration at which an electrode starts."""
    return f"Initial concentration in {which.lower()} electrode [mol.m-3]"


@dataclass(frozen=True, eq=False)
class _Balance:
    """How two electrodes share their lithium."""

    # x, y, voltage: Stoichiometries of the negative and of the positive electrode, and the open-circuit voltage there,
    # which never falls, V. Shape (n,).
    x: FloatArray
    y: FloatArray
    voltage: FloatArray
    empty: float  # Negative stoichiometry of an empty cell.
    full: float
    lithium: float  # What they share, mol/m2.
    held: Mapping[str, float]  # What each can hold, mol/m2.
    highest: Mapping[str, float]  # The same, mol/m3.


class InitialState:
    """Initial concentrations at a state of charge, for any candidate, without touching the compiled model.

    The electrodes hold :math:`Q_n` and :math:`Q_p` and share the lithium :math:`Q_{Li} = Q_n x + Q_p y` that their
    initial concentrations in the parameter set amount to. The cell is full where :math:`U_p(y) - U_n(x)` is the
    open-circuit voltage at 100 % and empty where it is that at 0 %; the state of charge is linear in between (Mohtat et
    al., J. Power Sources 427 (2019) 101). As in PyBaMM, both limits are those at the reference temperature, and a
    voltage at which a cell starts is that at its initial temperature. PyBaMM's own route through ``initial_soc``
    changes the initial conditions behind a solver that has already been set up: of several candidates in a row only the
    first is right. The set's values are taken before anything is opened to the search.
    """

    def __init__(self, values: Any) -> None:
        self._base = {
            name: _number(values, name)
            for which in ELECTRODES
            for name in (
                f"{which} electrode active material volume fraction",
                f"{which} electrode thickness [m]",
                maximum_concentration(which),
                initial_concentration(which),
            )
        }
        self._ocp = OcpCurves(values)
        self._warming = _warming(values)
        self._limits = _limits(values)

    def concentrations(self, change: CellChange, soc: float | None) -> dict[str, float]:
        """Initial concentration of both electrodes by PyBaMM's names, mol/m3, of a changed cell.

        Without a state of charge the negative electrode is the set's own. Raises `ValueError` if the electrodes cannot
        hold the lithium at this state of charge.
        """
        balance = self._balance(change)
        start = self._start(balance, soc)
        return {initial_concentration(which): start[which] * balance.highest[which] for which in ELECTRODES}

    @property
    def span(self) -> float:
        """Share of what the negative electrode holds that goes from an empty cell to a full one."""
        balance = self._balance(CellChange())
        return balance.full - balance.empty

    def inventory(self, change: CellChange) -> dict[str, float]:
        """Lithium that the electrodes share, under ``"lithium"``, and what each can hold, mol per m2 of electrode."""
        balance = self._balance(change)
        return {"lithium": balance.lithium, **balance.held}

    def voltages(
        self,
        change: CellChange,
        soc: float | None,
        drawn: FloatArray,
        added: Mapping[str, FloatArray] | None = None,
    ) -> FloatArray:
        """Open-circuit voltage at the initial temperature after charge was drawn, V, shape (n,); see `concentrations`.

        ``drawn``, shape (n,), is the lithium that has left the negative electrode since the start, mol per m2 of
        electrode; ``added`` is as in `soc_at`. Beyond what an electrode holds its potential stays at its last value.
        """
        balance = self._balance(change)
        start = self._start(balance, soc)
        potentials: dict[str, FloatArray] = {}
        for which, sign in (("Negative", -1.0), ("Positive", 1.0)):
            curve = self._ocp.curve(which, change) + sum(part[which] for part in self._parts(added) if which in part)
            potentials[which] = np.interp(start[which] + sign * drawn / balance.held[which], GRID, curve)
        return np.asarray(potentials["Positive"] - potentials["Negative"])

    def _start(self, balance: _Balance, soc: float | None) -> dict[str, float]:
        """The stoichiometry of each electrode at a state of charge."""
        own = self._base[initial_concentration("Negative")] / balance.highest["Negative"]
        negative = own if soc is None else float(balance.empty + soc * (balance.full - balance.empty))
        positive = (balance.lithium - balance.held["Negative"] * negative) / balance.held["Positive"]
        if not 0.0 < negative < 1.0 or not 0.0 < positive < 1.0:
            raise ValueError(f"stoichiometries {negative:.3f} and {positive:.3f} must lie between 0 and 1")
        return {"Negative": negative, "Positive": positive}

    def soc_at(
        self, voltage: float, change: CellChange | None = None, added: Mapping[str, FloatArray] | None = None
    ) -> float:
        """The state of charge of a changed cell at an open-circuit voltage; beyond 0 and 1 outside its limits.

        ``added`` is what effects add to the potential of an electrode on `GRID`, V; the limits are those without.
        Raises `ValueError`: as `concentrations`.
        """
        balance = self._balance(change or CellChange())
        curve, parts = balance.voltage, self._parts(added)
        if parts:
            for which, at, sign in (("Negative", balance.x, -1.0), ("Positive", balance.y, 1.0)):
                curve = curve + sign * sum(np.interp(at, GRID, part[which]) for part in parts if which in part)
            curve = np.maximum.accumulate(curve)
        return float((np.interp(voltage, curve, balance.x) - balance.empty) / (balance.full - balance.empty))

    def _parts(self, added: Mapping[str, FloatArray] | None) -> list[Mapping[str, FloatArray]]:
        """What temperature and effects add to the potentials, V on `GRID`, by electrode."""
        return [part for part in (self._warming, added) if part]

    def _balance(self, change: CellChange) -> _Balance:
        held: dict[str, float] = {}
        highest: dict[str, float] = {}
        lithium = 0.0
        for which in ELECTRODES:
            fraction, thickness, c_max, initial = (
                change.values.get(name, value) * change.factors.get(name, 1.0)
                for name, value in self._base.items()
                if which.lower() in name.lower()
            )
            highest[which] = c_max
            held[which] = fraction * thickness * c_max
            lithium += fraction * thickness * initial
        lithium *= change.cyclable_lithium
        x = GRID
        y = (lithium - held["Negative"] * x) / held["Positive"]
        possible = (y > GRID[0]) & (y < GRID[-1])
        if np.count_nonzero(possible) < 10:
            raise ValueError("no state of charge puts this lithium into both electrodes")
        x, y = x[possible], y[possible]
        negative_v, positive_v = (self._ocp.curve(which, change) for which in ELECTRODES)
        voltage = np.maximum.accumulate(np.interp(y, GRID, positive_v) - negative_v[possible])
        empty, full = np.interp(self._limits, voltage, x).tolist()
        return _Balance(x, y, voltage, empty, full, lithium, held, highest)


def changed_values(cell: CellModel, change: CellChange) -> pybamm.ParameterValues:
    """The whole parameter set of a changed cell, with the lithium that its electrodes then share."""
    values = load(cell.parameter_set, cell.overrides)
    bake(values, change)
    if change.cyclable_lithium != 1.0:
        values.update(InitialState(values).concentrations(CellChange(cyclable_lithium=change.cyclable_lithium), None))
    return values


def _limits(values: Any) -> tuple[float, float]:
    """Open-circuit voltages of an empty and of a full cell, V: its cut-offs may have been moved since."""
    empty, full = (_number(values, at_rest, cut_off) for cut_off, at_rest in CUT_OFFS.items())
    return empty, full


def _warming(values: Any) -> Mapping[str, FloatArray]:
    """What the initial temperature adds to each electrode's potential on `GRID`, V; empty at the reference one."""
    warmer = _number(values, "Initial temperature [K]") - _number(values, "Reference temperature [K]")
    if warmer == 0.0:
        return {}
    found: dict[str, FloatArray] = {}
    cell = pybamm.LithiumIonParameters()
    for which, domain in zip(ELECTRODES, (cell.n, cell.p), strict=True):
        symbol = domain.prim.dUdT(pybamm.Vector(GRID))
        curve = np.ravel(values.process_symbol(symbol).evaluate())
        found[which] = warmer * np.broadcast_to(curve, GRID.shape)
    return found


def _number(values: Any, *names: str) -> float:
    name = next((name for name in names if name in values), names[0])
    return float(values.evaluate(values[name]))
