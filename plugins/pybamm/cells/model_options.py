"""Model options as a person writes them, in PyBaMM's own spelling."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from ....core.errors import unknown
from ....core.printable import shown
from .parameter_sets import pybamm


def in_pybamm_spelling(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with names and values as PyBaMM has them, whatever their case; true and false as words.

    ``{"Contact resistance": True, "sei": "Reaction Limited"}``; a pair is one value for each electrode. A value that
    PyBaMM does not know stays as it is: PyBaMM names those that it has when the model is built. Raises `BsaError` if
    there is no option of such a name.
    """
    known = _known()
    result: dict[str, Any] = {}
    for name, value in options.items():
        own, values = known.get(str(name).casefold(), ("", {}))
        if not own:
            names = [known_name for known_name, _ in known.values()]
            raise unknown(f'PyBaMM has no model option "{shown(name)}".', str(name), names, "options: {}.")
        result[own] = _value(value, values)
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
