"""Diffusivities in particles that change with the stoichiometry, as factors near some of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....core.target import DiffusivityShape
from .ocp_shape import bump, by_curve


def shaped(diffusivity: Any, factors: Mapping[float, Any]) -> Any:
    """A diffusivity whose logarithm has bumps added to it.

    It is a number, or a function of stoichiometry and temperature, m2.s-1. ``factors`` are what it is multiplied by, by
    the stoichiometry at which all of the factor applies.
    """

    def function(stoichiometry: Any, temperature: Any) -> Any:
        own = diffusivity(stoichiometry, temperature) if callable(diffusivity) else diffusivity
        return own * np.exp(sum(np.log(factor) * bump(stoichiometry, at) for at, factor in factors.items()))

    return function


def reshape(values: Any, factors: Mapping[DiffusivityShape, Any]) -> None:
    """Shape the diffusivities of a parameter set, in place."""
    for name, own in by_curve(factors).items():
        values.update({name: shaped(values[name], own)})
