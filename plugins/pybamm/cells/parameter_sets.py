"""PyBaMM parameter sets: loading, filling gaps, and opening parameters to the search."""

import inspect
import os
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from ....core.errors import BsaError, did_you_mean
from ....core.parameters import Candidate
from ....core.printable import listed
from ....core.target import (
    CellChange,
    CurrentOffset,
    DiffusivityShape,
    Factor,
    InitialSoc,
    InitialVoltage,
    OcpShape,
    Target,
    Value,
    factor_name,
    ocp_name,
    target_named,
)
from ....core.task import NEAREST, CellModel, ParameterFile, ParameterSource
from .diffusivity_shape import reshape
from .ocp_shape import ELECTRODES, OcpCurves, correct

os.environ.setdefault("PYBAMM_DISABLE_TELEMETRY", "true")  # or the first import may prompt

import pybamm as pybamm  # after the line above; the other modules take it from here

FILL_FROM = ("OKane2022", "Chen2020")
"""Where keys that a set lacks are taken from; the second one counts where both have a key. SEI parameters are those of
Chen2020; those of plating, cracks and loss of active material are those of OKane2022, which is of the same cell."""

WHOLE_SET = (
    "Electrode width [m]",
    *(ocp_name(electrode) for electrode in ELECTRODES),
    "Maximum concentration in negative electrode [mol.m-3]",
    "Lower voltage cut-off [V]",
)
"""Parameters that a set must have itself; what else is lacking is filled in."""

CUT_OFFS = {
    "Lower voltage cut-off [V]": "Open-circuit voltage at 0% SOC [V]",
    "Upper voltage cut-off [V]": "Open-circuit voltage at 100% SOC [V]",
}
"""The voltage cut-offs, and the open-circuit voltages of an empty and of a full cell, which they are in most sets."""


def why_no_full_cell(values: Mapping[str, Any]) -> str | None:
    """What tells that values are not of a full cell with one material in each electrode; None where they are of one.

    The values are those of a set before gaps are filled: afterwards every set looks whole.
    """
    if any(name.startswith("Primary: ") for name in values):  # those of the first of two materials
        return "an electrode is a blend of two materials"
    numbers = [name for name in map(ocp_name, ELECTRODES) if name in values and not callable(values[name])]
    if numbers:
        return f'"{numbers[0]}" is a number, {values[numbers[0]]:g}'
    lacking = [name for name in WHOLE_SET if name not in values]
    return f"it lacks {listed(lacking)}" if lacking else None


@cache
def set_names() -> tuple[str, ...]:
    """Names of the installed parameter sets of full cells with one material in each electrode, sorted."""
    return tuple(name for name in sorted(pybamm.parameter_sets) if not why_no_full_cell(_own(name)))


def require_set(name: str) -> None:
    """Raises `BsaError` with the nearest name if no installed parameter set is called so."""
    if name not in pybamm.parameter_sets:
        raise BsaError(
            f'there is no parameter set "{name}".',
            (did_you_mean(name, (*set_names(), NEAREST)) or f"installed sets: {', '.join(set_names())}.")
            + " bsa list parameters shows them.",
        )


@cache
def _load(name: ParameterSource) -> Mapping[str, Any]:
    if not isinstance(name, ParameterFile):
        require_set(name)
    own = _own(name)
    reason = why_no_full_cell(own)
    if reason:
        raise BsaError(
            f"{name} is no full cell with one material in each electrode: {reason}.",
            "other cells are not simulated; bsa list parameters shows the sets.",
        )
    values: dict[str, Any] = {}
    for source in FILL_FROM:
        values.update(dict(pybamm.ParameterValues(source)))
    return {**values, **own}


def _own(name: ParameterSource) -> dict[str, Any]:
    """What a set says itself."""
    if isinstance(name, ParameterFile):
        from .parameter_files import read_values

        return read_values(name)
    return dict(pybamm.ParameterValues(name))


def states(name: ParameterSource, key: str) -> bool:
    """Whether a parameter set has the key itself: what it lacks is filled in."""
    return key in _own(name)


def load(name: ParameterSource, overrides: Mapping[str, float] | None = None) -> pybamm.ParameterValues:
    """A parameter set, gaps filled from `FILL_FROM`, with overrides put in.

    Raises `BsaError` if the set, or an overridden parameter, does not exist, or the set is not of a full cell with
    one material in each electrode: in the sets of half-cells the potential of lithium is a number, blends have two
    potentials for an electrode, lead-acid cells and equivalent circuits none.
    """
    values = pybamm.ParameterValues(dict(_load(name)))
    for key, value in (overrides or {}).items():
        values.update({require(name, key): value}, check_already_exists=False)
    return values


def require(set_name: ParameterSource, key: str) -> str:
    """The key itself, if the set knows it. Raises `BsaError` with the nearest name otherwise."""
    known = _load(set_name)
    if key in known:
        return key
    nearest = did_you_mean(key, known)
    raise BsaError(
        f'"{key}" is not a parameter of {set_name}.',
        f"{nearest} " * bool(nearest) + f"bsa list parameters --set {set_name} shows all {len(known)}.",
    )


def is_function(set_name: ParameterSource, key: str) -> bool:
    """Whether the parameter is a function of the state (an exchange-current density, a diffusivity, ...)."""
    return callable(_load(set_name)[require(set_name, key)])


def parameters(set_name: ParameterSource) -> dict[str, float | str]:
    """Every parameter of a set: its number, or ``"function"``."""
    return {
        key: "function" if callable(value) else float(value)
        for key, value in sorted(_load(set_name).items())
        if callable(value) or isinstance(value, (int, float))
    }


def target_in(set_name: ParameterSource, name: str, overrides: Mapping[str, float] | None = None) -> Target:
    """What a person's name for a parameter acts on in a set; what an override replaces is a value.

    Raises `BsaError` if the set has no such parameter, or a multiplier is asked for where the value itself can be
    searched, or the reverse.
    """
    if name in (overrides or {}):
        return Value(require(set_name, name))
    known = _load(set_name)
    target = target_named(name, known)
    if isinstance(target, Factor) and not callable(known[require(set_name, target.name)]):
        raise BsaError(f'"{target.name}" of {set_name} is a number.', f'search "{target.name}" itself, not "{name}".')
    if isinstance(target, OcpShape) and not is_function(set_name, target.ocp):
        raise BsaError(f'"{target.ocp}" of {set_name} is a number.', "only a function of stoichiometry has a shape.")
    if isinstance(target, Value) and is_function(set_name, name):
        raise BsaError(f'"{name}" of {set_name} is a function.', f'search the multiplier "{factor_name(name)}".')
    return target


_START_SOC = 0.5
"""Where the search for a state of charge starts when no record tells it."""


def initial_value(set_name: ParameterSource, name: str, overrides: Mapping[str, float] | None = None) -> float:
    """The value at which a search over ``name`` starts: the set's own, 1 for a factor, 0 for a correction.

    Raises `BsaError`: as `target_in`.
    """
    if name in (overrides or {}):
        return float((overrides or {})[require(set_name, name)])
    target = target_in(set_name, name)
    if isinstance(target, InitialSoc):
        return _START_SOC
    if isinstance(target, OcpShape | InitialVoltage | CurrentOffset):
        return 0.0
    return float(_load(set_name)[name]) if isinstance(target, Value) else 1.0


def open_to_search(values: pybamm.ParameterValues, targets: Mapping[str, Target]) -> None:
    """Turn what is searched, by the names of the inputs, into inputs of the compiled model, in place.

    Numbers become ``"[input]"``, numbers and functions with a factor are multiplied by an input, open-circuit
    potentials get bumps whose heights are inputs. Initial states need no input: they set the initial conditions.
    """
    for name, target in targets.items():
        if isinstance(target, Value):
            values.update({_known(values, target.name): "[input]"})
        elif isinstance(target, Factor):
            values.update({target.name: _scaled(values[target.name], pybamm.InputParameter(name))})
    shapes = {target: name for name, target in targets.items() if isinstance(target, OcpShape)}
    correct(values, {target: pybamm.InputParameter(name) for target, name in shapes.items()})
    factors = {target: name for name, target in targets.items() if isinstance(target, DiffusivityShape)}
    reshape(values, {target: pybamm.InputParameter(name) for target, name in factors.items()})


def input_values(targets: Mapping[str, Target], candidate: Candidate, change: CellChange) -> dict[str, float]:
    """The inputs of a model which `open_to_search` has opened, for a candidate and the change that it makes."""
    return {
        name: change.ocp_shape[target] if isinstance(target, OcpShape) else float(candidate[name])
        for name, target in targets.items()
        if isinstance(target, Value | Factor | OcpShape | DiffusivityShape)
    }


def bake(values: pybamm.ParameterValues, change: CellChange) -> None:
    """Put a candidate's numbers into the set, in place: the model is then built for it alone."""
    values.update({_known(values, name): value for name, value in change.values.items()})
    for name, factor in change.factors.items():
        values.update({name: _scaled(values[name], factor)})
    if change.ocp_shape:
        correct(values, OcpCurves(values).falling(CellChange(ocp_shape=change.ocp_shape)).ocp_shape)
    reshape(values, change.diffusivity_shape)


def as_simulated(cell: CellModel, change: CellChange) -> CellChange:
    """The change as simulations of the cell have it: open-circuit potentials fall, see `OcpCurves.falling`."""
    return OcpCurves(load(cell.parameter_set, cell.overrides)).falling(change) if change.ocp_shape else change


def voltage_window(values: Mapping[str, Any]) -> tuple[float, float]:
    """Lower and upper voltage cut-off of a cell's values, V."""
    lowest, highest = (float(values[name]) for name in CUT_OFFS)
    return lowest, highest


def _known(values: pybamm.ParameterValues, name: str) -> str:
    if name not in values:
        raise KeyError(name)  # PyBaMM would take it for a new parameter
    return name


def _scaled(value: Any, factor: Any) -> Any:
    if not callable(value):
        return factor * value

    def scaled(*arguments: Any, **keywords: Any) -> Any:
        return factor * value(*arguments, **keywords)

    take_arguments(scaled, arguments_of(value))
    return scaled


def take_arguments(function: Any, names: Iterable[str]) -> None:
    """Give a function of any arguments these names for them, in place: PyBaMM writes functions to files by them."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    function.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])


def arguments_of(function: Any) -> tuple[str, ...]:
    """The arguments that a function of a set still takes, by name: the others are bound already."""
    return tuple(
        argument.name
        for argument in inspect.signature(function).parameters.values()
        if argument.default is argument.empty and argument.kind is argument.POSITIONAL_OR_KEYWORD
    )
