"""What is searched, without the parameters that have no influence on the model."""

import re
from collections.abc import Iterable
from dataclasses import replace

from ...core.errors import BsaError
from ...core.parameters import ParameterSpace
from ...core.target import Value
from ...core.task import CellModel

_UNIT = re.compile(r"\s*\[[^\[\]]*\]( factor)?")
"""In a parameter's name its unit, and that it multiplies what has one."""


def simulated_models(cell: CellModel, over_time: bool, spectra: bool) -> list[CellModel]:
    """The models by which a cell's records are simulated, those over time and spectra; the first one if there are none.

    That of a spectrum alone has the double layers.
    """
    from ...plugins.pybamm.solving.spectrum_experiment import DOUBLE_LAYERS

    with_layers = replace(cell, options={**cell.options, **DOUBLE_LAYERS})
    return [*[cell] * (over_time or not spectra), *[with_layers] * spectra]


def with_influence(space: ParameterSpace, models: list[CellModel], whose: str = "") -> tuple[ParameterSpace, list[str]]:
    """The space without parameters on which none of the models depends, and what is to be said of these.

    ``whose`` says whose parameters they are; empty for those that the person has named. Raises `BsaError` if one of
    these has no influence, or no parameter has one.
    """
    from ...plugins.pybamm.before_search.influence import without_influence

    in_none = set.intersection(*(set(without_influence(model, space.targets)) for model in models))
    idle = [name for name in space.names if name in in_none]
    if not idle:
        return space, []
    model = models[0].model
    if not whose:
        raise no_influence(idle[0], models[0])
    if len(idle) == len(space):
        raise BsaError(f"none of the parameters of {whose} has an influence in the model {model}.", "choose others.")
    named = ", ".join(_UNIT.sub("", name) for name in idle)
    return ParameterSpace(tuple(parameter for parameter in space if parameter.name not in idle)), [
        f"The model {model} does not depend on these parameters, so they are not searched: {named}."
    ]


def without_use(cell: CellModel, overrides: Iterable[str]) -> list[str]:
    """What is to be said of values that replace those of the set and that the model does not depend on."""
    from ...plugins.pybamm.before_search.influence import without_influence

    idle = without_influence(cell, {name: Value(name) for name in overrides})
    named = ", ".join(f'"{name}"' for name in idle)
    return [f"The model {cell.model} does not depend on what overrides gives it: {named}."] if idle else []


def no_influence(name: str, cell: CellModel) -> BsaError:
    """The error of a person who names a parameter on which the model does not depend."""
    options = ", ".join(f"{key}={value}" for key, value in cell.options.items())
    return BsaError(
        f'"{name}" has no influence in the model {cell.model}{f" with {options}" * bool(options)}.',
        "leave it out of the search, or choose a model or model options that depend on it.",
    )
