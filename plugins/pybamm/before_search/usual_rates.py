"""Rates of diffusion and reaction that lie far from those of every other installed parameter set."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from ....core.target import CellChange
from ....core.task import ParameterFile, ParameterSource
from ..cells.ocp_shape import ELECTRODES
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import bake, load, pybamm
from ..cells.state_of_charge import maximum_concentration
from .nearest_potentials import published_potentials

_DEVIATIONS = 3.0
"""Distance from the mean of the other sets' logarithms, in their standard deviations, from which on a rate is far from
them. Two rates of the installed sets are as far, at 3.4 and 5.3; the next is at 2.8."""

_USUAL_CONCENTRATION = 1000.0
"""Of the electrolyte where exchange-current densities are compared, mol.m-3."""


def unusual_rates(base: ParameterSource) -> dict[str, float]:
    """Rates of a set that lie far from those of all other installed lithium-ion sets, by PyBaMM's names.

    Of each the factor that gives the nearest rate of the others. What a diffusivity or an exchange-current density does
    to a voltage depends on the size and the capacity of the particles too. Compared are the inverse times ``D / R^2``
    and ``3 j0 / (R F c_max)`` at half of the lithium, 1/s.
    """
    values = load(base)
    factors = {name: _factor(name, rate(values)) for name, rate in _RATES.items()}
    return {name: factor for name, factor in factors.items() if factor is not None}


def with_usual_rates(base: ParameterSource, unusual: Mapping[str, float]) -> ParameterFile:
    """The set with rates multiplied by their factors; see `unusual_rates`."""
    values = load(base)
    bake(values, CellChange(factors=dict(unusual)))
    return ParameterFile(f"{base} with usual rates", "parameter-values", as_json(values))


def _factor(name: str, rate: float) -> float | None:
    """What leads to the nearest rate of the other sets; None for a rate that is near them."""
    own = np.log(rate)
    # A set whose rate is the same is this set, or one that took the rate from the same source.
    others = np.array([log for log in _published(name) if not np.isclose(log, own)])
    if abs(own - np.mean(others)) < _DEVIATIONS * np.std(others):
        return None
    return float(np.exp(others[np.argmin(np.abs(others - own))] - own))


@cache
def _published(name: str) -> tuple[float, ...]:
    """Logarithms of a rate in the installed lithium-ion sets, each once."""
    logs = np.sort([np.log(_RATES[name](load(other))) for other in published_potentials(ELECTRODES[0])])
    return tuple(log for log, before in zip(logs, (-np.inf, *logs), strict=False) if not np.isclose(log, before))


def _diffusion(which: str, name: str, values: Any) -> float:
    return _number(values, name, 0.5) / float(values[f"{which} particle radius [m]"]) ** 2


def _reaction(which: str, name: str, values: Any) -> float:
    highest = float(values[maximum_concentration(which)])
    density = _number(values, name, _USUAL_CONCENTRATION, 0.5 * highest, highest)
    radius = float(values[f"{which} particle radius [m]"])
    return 3.0 * density / (radius * float(pybamm.constants.F.value) * highest)


def _number(values: Any, name: str, *arguments: float) -> float:
    """A parameter at the reference temperature, and at these arguments where it is a function."""
    value = values[name]
    if not callable(value):
        return float(value)
    temperature = pybamm.Scalar(float(values["Reference temperature [K]"]))
    symbol = value(*(pybamm.Scalar(argument) for argument in arguments), temperature)
    return float(np.ravel(values.process_symbol(symbol).evaluate())[0])


_RATES: dict[str, Callable[[Any], float]] = {
    name: partial(rate, which, name)
    for which in ELECTRODES
    for name, rate in (
        (f"{which} particle diffusivity [m2.s-1]", _diffusion),
        (f"{which} electrode exchange-current density [A.m-2]", _reaction),
    )
}
