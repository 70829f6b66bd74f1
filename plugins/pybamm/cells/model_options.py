"""Model options as a person writes them, in PyBaMM's own spelling."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from ....core.errors import BsaError, did_you_mean, unknown
from ....core.printable import shown
from .parameter_sets import pybamm


def in_pybamm_spelling(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with names and values as PyBaMM has them, whatever their case; true and false as words.

    ``{"Contact resistance": True, "sei": "Reaction Limited"}``; a pair is one value for each electrode. Raises
    `BsaError` if there is no option of such a name, or it has no such value.
    """
    known = _known()
    result: dict[str, Any] = {}
    for name, value in options.items():
        own, values = known.get(str(name).casefold(), ("", {}))
        if not own:
            names = [known_name for known_name, _ in known.values()]
            raise unknown(f'PyBaMM has no model option "{shown(name)}".', str(name), names, "options: {}.")
        result[own] = _value(own, value, values)
    return result


def as_built(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as PyBaMM builds a model with them: a pair, which JSON keeps as a list, is a tuple."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}


@cache
def _known() -> Mapping[str, tuple[str, Mapping[str, str]]]:
    """By name in lower case: PyBaMM's name, and its values by theirs."""
    possible = pybamm.BatteryModelOptions({}).possible_options
    return {
        name.casefold(): (name, {value.casefold(): value for value in values if isinstance(value, str)})
        for name, values in possible.items()
    }


def _value(option: str, value: Any, known: Mapping[str, str]) -> Any:
    if isinstance(value, (list, tuple)):
        return [_value(option, part, known) for part in value]
    text = str(value).casefold()
    if text in known:
        return known[text]
    if not isinstance(value, (str, bool)):
        return value  # of an option that takes numbers, or refused by PyBaMM when the model is built
    message = f'the model option "{option}" has no value "{shown(text if isinstance(value, bool) else value)}".'
    listed = f"Values: {', '.join(known.values())}."
    raise BsaError(message, " ".join(filter(None, [did_you_mean(text, known.values()), listed])))
