"""PyBaMM parameter sets: loading, filling gaps, and opening parameters to the search."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from ...core.errors import BsaError, did_you_mean

os.environ.setdefault("PYBAMM_DISABLE_TELEMETRY", "true")  # or the first import may prompt

import pybamm as pybamm  # after the line above; the other modules take it from here

FILL_FROM = "Chen2020"
"""Where keys that a set lacks (SEI parameters, mostly) are taken from."""

INITIAL_SOC = "Initial state of charge"
"""A searchable name that PyBaMM does not know: sets the initial stoichiometries through the cell's limits."""

FACTOR = " factor"
"""Suffix that turns a function-valued parameter into a searchable multiplier on it."""


@cache
def set_names() -> tuple[str, ...]:
    """Names of the installed parameter sets, sorted."""
    return tuple(sorted(pybamm.parameter_sets))


@cache
def _load(name: str) -> Mapping[str, Any]:
    if name not in pybamm.parameter_sets:
        raise BsaError(
            f'there is no parameter set "{name}".',
            (did_you_mean(name, set_names()) or f"installed sets: {', '.join(set_names())}.")
            + " bsa list parameters shows them.",
        )
    values = dict(pybamm.ParameterValues(FILL_FROM)) if name != FILL_FROM else {}
    values.update(dict(pybamm.ParameterValues(name)))
    return values


def load(name: str, overrides: Mapping[str, float] | None = None) -> pybamm.ParameterValues:
    """A parameter set by name, gaps filled from Chen2020, with overrides put in.

    Raises
    ------
    BsaError
        If the set, or an overridden parameter, does not exist.
    """
    values = pybamm.ParameterValues(dict(_load(name)))
    for key, value in (overrides or {}).items():
        values.update({require(name, key): value}, check_already_exists=False)
    return values


def require(set_name: str, key: str) -> str:
    """The key itself, if the set knows it.

    Raises
    ------
    BsaError
        With the nearest name otherwise.
    """
    known = _load(set_name)
    if key in known:
        return key
    nearest = did_you_mean(key, known)
    raise BsaError(
        f'"{key}" is not a parameter of {set_name}.',
        f"{nearest} " * bool(nearest) + f"bsa list parameters --set {set_name} shows all {len(known)}.",
    )


def is_function(set_name: str, key: str) -> bool:
    """Whether the parameter is a function of the state (an exchange-current density, a diffusivity, ...)."""
    return callable(_load(set_name)[require(set_name, key)])


def parameters(set_name: str) -> dict[str, float | str]:
    """Every parameter of a set: its number, or ``"function"``."""
    return {
        key: "function" if callable(value) else float(value)
        for key, value in sorted(_load(set_name).items())
        if callable(value) or isinstance(value, (int, float))
    }


def initial_value(set_name: str, name: str, overrides: Mapping[str, float] | None = None) -> float:
    """The value at which a search over ``name`` starts: the set's own, or 1 for a factor.

    Raises
    ------
    BsaError
        If the parameter does not exist, or is a function and lacks the suffix `` factor``.
    """
    if name.startswith(INITIAL_SOC):
        return 0.5
    if name.endswith(FACTOR) and name not in _load(set_name):
        base = require(set_name, name.removesuffix(FACTOR))
        if not callable(_load(set_name)[base]):
            raise BsaError(f'"{base}" of {set_name} is a number.', f'search "{base}" itself, without "{FACTOR}".')
        return 1.0
    require(set_name, name)
    value = (overrides or {}).get(name, _load(set_name)[name])
    if callable(value):
        raise BsaError(f'"{name}" of {set_name} is a function.', f'search the multiplier "{name}{FACTOR}".')
    return float(value)


def open_to_search(values: pybamm.ParameterValues, names: Iterable[str]) -> None:
    """Turn the named parameters into inputs of the compiled model, in place.

    Scalars become ``"[input]"``; a name with the suffix `` factor`` multiplies its function by an
    input of that name. Initial states of charge need no input: they set the initial conditions.
    """
    for name in names:
        if name.startswith(INITIAL_SOC):
            continue
        if name in values:
            values.update({name: "[input]"})
        else:
            base = name.removesuffix(FACTOR)
            values.update({base: _scaled(values[base], pybamm.InputParameter(name))})


def bake(values: pybamm.ParameterValues, candidate: Mapping[str, float]) -> None:
    """Put a candidate's numbers into the set, in place: the model is then built for it alone."""
    for name, value in candidate.items():
        if name.startswith(INITIAL_SOC):
            continue
        if name in values:
            values.update({name: value})
        else:
            base = name.removesuffix(FACTOR)
            values.update({base: _scaled(values[base], value)})


def _scaled(function: Callable[..., Any], factor: Any) -> Callable[..., Any]:
    def scaled(*arguments: Any, **keywords: Any) -> Any:
        return factor * function(*arguments, **keywords)

    return scaled
