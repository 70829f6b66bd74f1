"""Changes of parameters as a model writes them: their schema, and the candidate that they lead to."""

from collections.abc import Mapping
from typing import Any

from ...core.errors import BsaError, did_you_mean
from ...core.parameters import Candidate, ParameterSpace
from ...core.printable import strip_control
from ...core.proposal import CHANGE_PATTERN, apply_change


def updates_schema(space: ParameterSpace) -> dict[str, Any]:
    """JSON Schema of a set of changes: each parameter may appear, nothing else may."""
    change = {"type": "string", "pattern": CHANGE_PATTERN, "maxLength": 24}
    return {
        "type": "object",
        "properties": dict.fromkeys(space.names, change),
        "additionalProperties": False,
        "minProperties": 1,
    }


def apply_updates(
    updates: Any, space: ParameterSpace, base: Candidate
) -> tuple[dict[str, float], dict[str, str], tuple[str, ...]]:
    """The candidate, the changes as written, and the names of the parameters that hit a bound.

    Raises `BsaError` if it changes nothing, names an unknown parameter, or a change is not a finite number; the message
    is made to be sent back to the model.
    """
    if not isinstance(updates, Mapping):
        raise BsaError(
            'the reply has no object "updated_params".', 'write {"updated_params": {"<name>": "*1.2"}, ...}.'
        )
    if not updates:
        raise BsaError('"updated_params" is empty.', "change at least one parameter.")
    candidate = dict(base)
    projected: list[str] = []
    written: dict[str, str] = {}
    for name, change in updates.items():
        if name not in space:
            raise unknown_parameter(name, space)
        try:
            value = apply_change(base[name], change)
        except BsaError as error:
            raise BsaError(f'"{name}": {error.message}', error.hint) from None
        candidate[name] = space[name].project(value)
        written[name] = str(change)
        if candidate[name] != value:
            projected.append(name)
    return candidate, written, tuple(projected)


def unknown_parameter(name: Any, space: ParameterSpace) -> BsaError:
    """The error of a name that is not searched."""
    return BsaError(
        f'"{strip_control(str(name))[:80]}" is not a searched parameter.',
        did_you_mean(str(name), space.names) or "searched are " + ", ".join(f'"{one}"' for one in space.names) + ".",
    )
