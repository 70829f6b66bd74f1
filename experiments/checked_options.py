"""What a person said, checked in the words that were used: options, not fields."""

import os
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from numbers import Integral
from typing import Any, get_args

from scipy.constants import zero_Celsius

from ..core.errors import BsaError, did_you_mean
from ..core.printable import shown
from ..core.record import AMBIENT_C, ImpedancePart, Signal

FIELDS: Mapping[str, str] = {
    "columns": "column",
    "units": "unit",
    "constant_current_a": "constant_current",
    "current_offset_a": "current_offset",
    "voltage_lag_s": "voltage_lag",
    "ambient_c": "temperature",
}
"""Fields of `ReadOptions` that are said under another name."""

_SIGNALS: tuple[str, ...] = get_args(Signal)
_PARTS: tuple[str, ...] = get_args(ImpedancePart)


def as_number(value: Any, option: str) -> float:
    """The number that was given for an option. Raises `BsaError` if it is none."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = float("nan")
    if isinstance(value, bool) or not isfinite(found):
        raise BsaError(f"{option} is {shown(repr(value))}, which is no number.", "give a number.")
    return found


def as_numbers(given: Any, option: str) -> list[float]:
    """One number, several or none, as a list. Raises `BsaError` if one is no number."""
    return [as_number(value, option) for value in as_several(given)]


def as_several(given: Any) -> list[Any]:
    """One value, several or none, as a list; the values are not checked."""
    if given is None:
        return []
    several = isinstance(given, Iterable) and not isinstance(given, str | bytes | Mapping)
    return list(given) if several else [given]


def as_names(given: Any, option: str) -> list[str]:
    """One name, several or none, as a list. Raises `BsaError` if one is no text."""
    names = as_several(given)
    for name in names:
        if not isinstance(name, str):
            raise BsaError(f"{option} is {shown(repr(name))}, which is no name.", "give a name, or a list of names.")
    return names


def as_mapping(given: Any, option: str) -> Mapping[str, Any]:
    """Keys with values, or none. Raises `BsaError` if it is text, or a list of texts, with what to write."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return given
    pairs = [str(text).partition("=") for text in as_several(given)]
    meant = {key.strip(): value.strip() for key, _, value in pairs if key.strip() and value.strip()}
    raise BsaError(
        f"{option} is {shown(repr(given))}, which has no keys with values.",
        f"give a mapping, {shown(repr(meant or {'KEY': 'VALUE'}))}.",
    )


def as_celsius(value: Any, option: str) -> float:
    """The ambient temperature that was given, in degC. Raises `BsaError` if it is none, or one in kelvin."""
    found, (coldest, warmest) = as_number(value, option), AMBIENT_C
    if coldest < found < warmest:
        return found
    hint = "give the temperature around the cell in degC."
    if warmest <= found <= warmest + zero_Celsius:
        hint = f"{found:g} K are {found - zero_Celsius:.6g} degC."
    raise BsaError(f"{option} is {found:g}: it is in degC, between {coldest:g} and {warmest:g}.", hint)


def by_signal(given: Mapping[str, Any] | None, option: str) -> dict[str, str]:
    """What was given for each signal, as text. Raises `BsaError` if one is no signal."""
    return _by_name(given, option, _SIGNALS, f"Signals: {', '.join(_SIGNALS)}.")


def by_column(given: Mapping[str, Any] | None, option: str) -> dict[str, str]:
    """The column that was given for each signal or part of an impedance, as text: a column may be numbered.

    Raises `BsaError` if one is neither.
    """
    known = f"Signals: {', '.join(_SIGNALS)}; of an impedance: {', '.join(_PARTS)}."
    return _by_name(given, option, (*_SIGNALS, *_PARTS), known)


def _by_name(given: Mapping[str, Any] | None, option: str, names: Sequence[str], known: str) -> dict[str, str]:
    said = as_mapping(given, option)
    for key, value in said.items():
        if key not in names:
            nearest = did_you_mean(str(key), names)
            raise BsaError(
                f'{option} {shown(key)}={shown(value)}: there is no signal "{shown(key)}".',
                f"{nearest} " * bool(nearest) + known,
            )
    return {key: str(value) for key, value in said.items()}


def simulation_workers(asked: int) -> int:
    """How many simulations run side by side: what was asked for, or one on each of up to four cores.

    Raises `BsaError` if it is no number of simulations.
    """
    if isinstance(asked, bool) or not isinstance(asked, Integral) or asked < 0:
        raise BsaError(
            f"--workers is {shown(repr(asked))}, which is no number of simulations.",
            "give how many run side by side; 0 takes as many as there are cores, 4 at most.",
        )
    return int(asked) or min(os.cpu_count() or 1, 4)
