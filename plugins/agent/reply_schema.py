"""The shape of a reply, generated from the task's parameter space, and the check of what came."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...core.errors import BsaError, did_you_mean
from ...core.messages import JsonSchema
from ...core.parameters import Candidate, ParameterSpace
from ...core.proposal import CHANGE_PATTERN, apply_change
from ...core.reply_parsing import strip_control

_TEXT_LIMITS = {"analysis": 800, "hypothesis": 300, "rationale": 500}


def updates_schema(space: ParameterSpace) -> dict[str, Any]:
    """JSON Schema of a set of changes: each parameter may appear, nothing else may."""
    change = {"type": "string", "pattern": CHANGE_PATTERN, "maxLength": 24}
    return {
        "type": "object",
        "properties": dict.fromkeys(space.names, change),
        "additionalProperties": False,
        "minProperties": 1,
    }


def reply_schema(space: ParameterSpace) -> JsonSchema:
    """JSON Schema of a whole reply; flat, every string bounded, since servers differ in what they support."""
    texts = {name: {"type": "string", "maxLength": limit} for name, limit in _TEXT_LIMITS.items()}
    return {
        "type": "object",
        "properties": {
            "analysis": texts["analysis"],
            "hypothesis": texts["hypothesis"],
            "updated_params": updates_schema(space),
            "rationale": texts["rationale"],
        },
        "required": ["analysis", "hypothesis", "updated_params", "rationale"],
        "additionalProperties": False,
    }


@dataclass(frozen=True)
class CheckedReply:
    """A reply that passed.

    Attributes
    ----------
    candidate : Candidate
        The values it asks for, projected onto the bounds.
    updates : mapping of str to str
        The changes as written.
    projected : tuple of str
        Parameters whose value was moved to a bound.
    analysis, hypothesis, rationale : str
        The model's words, shortened and without control characters.
    """

    candidate: Candidate
    updates: Mapping[str, str]
    projected: tuple[str, ...]
    analysis: str
    hypothesis: str
    rationale: str


def check_reply(reply: Mapping[str, Any], space: ParameterSpace, base: Candidate) -> CheckedReply:
    """Check a parsed reply against the space and apply its changes to the base.

    Raises
    ------
    BsaError
        If it changes nothing, names an unknown parameter, or a change is not a finite number; the
        message is made to be sent back to the model.
    """
    updates = reply.get("updated_params")
    if not isinstance(updates, Mapping):
        raise BsaError(
            'the reply has no object "updated_params".', 'write {"updated_params": {"<name>": "*1.2"}, ...}.'
        )
    candidate, written, projected = apply_updates(updates, space, base)
    words = {name: strip_control(str(reply.get(name, "")))[:limit] for name, limit in _TEXT_LIMITS.items()}
    return CheckedReply(candidate, written, projected, **words)


def apply_updates(
    updates: Mapping[Any, Any], space: ParameterSpace, base: Candidate
) -> tuple[dict[str, float], dict[str, str], tuple[str, ...]]:
    """The candidate, the changes as written, and the names of the parameters that hit a bound.

    Raises
    ------
    BsaError
        As `check_reply`.
    """
    if not updates:
        raise BsaError('"updated_params" is empty.', "change at least one parameter.")
    candidate = dict(base)
    projected: list[str] = []
    written: dict[str, str] = {}
    for name, change in updates.items():
        if name not in space:
            shown = strip_control(str(name))[:80]
            raise BsaError(
                f'"{shown}" is not a searched parameter.',
                did_you_mean(str(name), space.names) or f"the searched parameters are {list(space.names)}.",
            )
        try:
            value = apply_change(base[name], change)
        except BsaError as error:
            raise BsaError(f'"{name}": {error.message}', error.hint) from None
        candidate[name] = space[name].project(value)
        written[name] = str(change)
        if candidate[name] != value:
            projected.append(name)
    return candidate, written, tuple(projected)
