"""Model options as a person writes them, in PyBaMM's own spelling."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from .parameter_sets import pybamm


def in_pybamm_spelling(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with names and values as PyBaMM has them, whatever their case; true and false as words.

    ``{"Contact resistance": True, "sei": "Reaction Limited"}``; a pair is one value for each electrode. What PyBaMM
    does not know stays as it is: PyBaMM names the nearest option when the model is built.
    """
    known = _known()
    result: dict[str, Any] = {}
    for name, value in options.items():
        own = known.get(str(name).casefold(), (str(name), {}))
        result[own[0]] = _value(value, own[1])
    return result


@cache
def _known() -> Mapping[str, tuple[str, Mapping[str, str]]]:
    """By name in lower case: PyBaMM's name, and its values by theirs."""
    possible = pybamm.BatteryModelOptions({}).possible_options
    return {
        name.casefold(): (name, {value.casefold(): value for value in values if isinstance(value, str)})
        for name, values in possible.items()
    }


def _value(value: Any, known: Mapping[str, str]) -> Any:
    if isinstance(value, (list, tuple)):
        return [_value(part, known) for part in value]
    text = str(value).casefold()
    return known.get(text, text if isinstance(value, bool) else value)
