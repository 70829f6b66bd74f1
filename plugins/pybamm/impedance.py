"""The impedance of a cell, from the equations that simulate its records."""

from __future__ import annotations

from dataclasses import replace

from ...core.errors import BsaError
from ...core.parameters import Candidate, ParameterSpace
from ...core.spectrum import ImpedanceSpectrum
from ...core.target import change_of
from ...core.task import CellModel
from .compiled_cell import make_model
from .parameter_sets import bake, load, pybamm
from .state_of_charge import InitialState

_SURFACE_FORM = {"surface form": "differential"}
"""With the capacity of the double layers, without which a cell has no arc."""


def simulate_spectrum(
    cell: CellModel, space: ParameterSpace, candidate: Candidate, measured: ImpedanceSpectrum, soc: float | None = None
) -> tuple[ImpedanceSpectrum, float]:
    """The spectrum of a candidate's cell at rest, at the frequencies and the temperature of a measured one.

    Parameters
    ----------
    measured : ImpedanceSpectrum
        Frequencies, and the voltage at rest that tells the state of charge.
    soc : float, optional
        State of charge, 0 to 1, where it is known better.

    Returns
    -------
    spectrum : ImpedanceSpectrum
        Without inductance, which lies in the leads.
    soc : float
        At which it was computed.

    Raises
    ------
    BsaError
        If the state of charge is not known or cannot be reached, or PyBaMM cannot solve it.
    """
    if soc is None and measured.voltage is None:
        raise BsaError(
            f"{measured.name} has no voltage, so that its state of charge is not known.", "give --initial-soc."
        )
    values = load(cell.parameter_set, cell.overrides)
    change = change_of(space.targets, candidate)
    state = InitialState(values)
    bake(values, change)
    if measured.temperature_k is not None:
        values.update(dict.fromkeys(("Ambient temperature [K]", "Initial temperature [K]"), measured.temperature_k))
    model = make_model(replace(cell, options={**cell.options, **_SURFACE_FORM}))
    try:
        if soc is None:
            assert measured.voltage is not None
            soc = state.soc_at(measured.voltage, change)
        values.update(state.concentrations(change, soc))
        found = pybamm.EISSimulation(model, parameter_values=values).solve(measured.frequency)
    except (pybamm.SolverError, pybamm.ModelError, ValueError, ArithmeticError, RuntimeError) as error:
        raise BsaError(
            f"the impedance of {measured.name} cannot be simulated: {' '.join(str(error).split())[:200]}",
            "give --initial-soc, if its voltage is not that of a cell at rest.",
        ) from None
    return replace(measured, impedance=found["Impedance [Ohm]"], voltage=None, notes=()), soc
