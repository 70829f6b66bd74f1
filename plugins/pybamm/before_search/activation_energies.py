"""Rates that become faster in a warm cell: in parameter sets in which they do not, or as records tell."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....core.task import ParameterFile, ParameterSource
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import arguments_of, load, pybamm, take_arguments


@dataclass(frozen=True)
class Transport:
    """How a diffusivity or conductivity is made to depend on the temperature."""

    argument: str  # Of the function, beside the temperature.
    usual: float  # A value of that argument, to look at the function there.
    energy: float  # Activation energy, J/mol.


_PARTICLE = Transport("stoichiometry", 0.5, 2.0e4)

TRANSPORT = {
    "Negative particle diffusivity [m2.s-1]": _PARTICLE,
    "Positive particle diffusivity [m2.s-1]": _PARTICLE,
    "Electrolyte diffusivity [m2.s-1]": Transport("concentration", 1000.0, 2.0e4),
    "Electrolyte conductivity [S.m-1]": Transport("concentration", 1000.0, 1.5e4),
}
"""By PyBaMM's names. Activation energies are rounded medians of the installed sets that have one (17 of 4 to 43 and 19
of 5 to 81 kJ/mol in the particles, 19 of 17 to 37 and 15 of 12 to 35 in the electrolyte; sets with the same functions
count once)."""

_REACTION = ("c_e", "c_s_surf", "c_s_max", "T")

_ARGUMENTS = {
    **{name: (transport.argument, "T") for name, transport in TRANSPORT.items()},
    "Negative electrode exchange-current density [A.m-2]": _REACTION,
    "Positive electrode exchange-current density [A.m-2]": _REACTION,
}
"""What PyBaMM gives to each rate that is a function: an exchange-current density depends on both concentrations."""

RATES = tuple(_ARGUMENTS)
"""What records at several temperatures tell an activation energy of, by PyBaMM's names."""

_WITH_ENERGIES = " with activation energies"
"""Ends the name of a set that was given some."""

_COLD_AND_WARM_K = (298.15, 308.15)


def energy_name(transport: str) -> str:
    """PyBaMM's name for the activation energy of a diffusivity or conductivity (its BPX reader's)."""
    return f"{transport.split(' [')[0]} activation energy [J.mol-1]"


def additional_energy_name(rate: str) -> str:
    """Name of what is added to the activation energy that a diffusivity, conductivity or reaction has in its set."""
    return f"{rate.split(' [')[0]} additional activation energy [J.mol-1]"


def independent_of_temperature(base: ParameterSource) -> tuple[str, ...]:
    """Diffusivities and conductivities of a set that are the same in a cold and in a warm cell."""
    values = load(base)
    return tuple(name for name in TRANSPORT if name in values and _is_independent(values, name))


def _is_independent(values: Any, name: str) -> bool:
    function = values[name]
    if not callable(function):
        return True
    if len(arguments_of(function)) != 2:
        return False  # not a lithium-ion cell's
    usual = pybamm.Scalar(TRANSPORT[name].usual)
    symbols = [function(usual, pybamm.Scalar(kelvin)) for kelvin in _COLD_AND_WARM_K]
    cold, warm = (np.ravel(values.process_symbol(symbol).evaluate()) for symbol in symbols)
    return bool(np.all(cold == warm))


def with_activation_energies(base: ParameterSource, transport: tuple[str, ...]) -> ParameterFile:
    """A parameter set in which diffusivities and conductivities, of `TRANSPORT`, follow Arrhenius' law.

    At the set's reference temperature they are what they were. Their activation energies are parameters of the set.
    """
    values = load(base)
    for name in transport:
        values.update({energy_name(name): TRANSPORT[name].energy}, check_already_exists=False)
        values.update({name: _arrhenius(values[name], _ARGUMENTS[name], energy_name(name))})
    return ParameterFile(f"{base}{_WITH_ENERGIES}", "parameter-values", as_json(values))


def with_additional_energies(base: ParameterSource, rates: Iterable[str] = RATES) -> ParameterFile:
    """A parameter set in which some of the `RATES` have an additional activation energy, 0 to begin with.

    Each is multiplied by a law of Arrhenius that is 1 at the set's reference temperature. A rate that the set lacks is
    left out.
    """
    values = load(base)
    for name in (name for name in rates if name in values):
        own, energy = values[name], additional_energy_name(name)
        arguments = arguments_of(own) if callable(own) else _ARGUMENTS[name]
        values.update({energy: 0.0}, check_already_exists=False)
        values.update({name: _arrhenius(own, arguments, energy)})
    name = f"{base} (searched)" if str(base).endswith(_WITH_ENERGIES) else f"{base} with additional activation energies"
    return ParameterFile(name, "parameter-values", as_json(values))


def _arrhenius(own: Any, arguments: tuple[str, ...], energy: str) -> Callable[..., Any]:
    """A number or function of a set times the law of Arrhenius; the last of the arguments is the temperature."""

    def warmed(*given: Any, **named: Any) -> Any:
        values = (*given, *named.values())
        reference = pybamm.Parameter("Reference temperature [K]")
        exponent = pybamm.Parameter(energy) / pybamm.constants.R * (1 / reference - 1 / values[-1])
        return pybamm.exp(exponent) * (own(*values) if callable(own) else own)

    take_arguments(warmed, arguments)
    return warmed
