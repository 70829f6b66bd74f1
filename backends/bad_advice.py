"""Random and adversarial advice, for the no-harm study.

Both read the schema alone, never the task, so they serve any proposer that asks for changes or actions.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..core.hooks import NoOptions
from ..core.messages import JsonSchema, Message, Reply

_SPREAD = 0.4
"""Standard deviation of the logarithm of a random change."""


class _Advice:
    """What both have in common."""

    sees_images = False

    def __init__(self, options: NoOptions | None = None) -> None:
        pass

    def close(self) -> None:
        """Nothing to release."""


class RandomAdvice(_Advice):
    """Answers every question at random, in the form that was asked for."""

    name = "random-advice"

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        rng = np.random.default_rng(seed)
        return Reply(json.dumps(_fill(schema, rng, lambda: f"*{np.exp(_SPREAD * rng.standard_normal()):.4g}")))


class AdversarialAdvice(_Advice):
    """Sends the search into corners, always with the largest allowance, and never says that all is well."""

    name = "adversarial-advice"

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        rng = np.random.default_rng(seed)
        answer = _fill(schema, rng, lambda: "1e30" if rng.random() < 0.5 else "1e-30", everything=True)
        if "action" in answer:
            answer["action"] = "set"
        if "simulations" in answer:
            answer["simulations"] = schema["properties"]["simulations"]["maximum"]
        return Reply(json.dumps(answer))


def _fill(
    schema: Mapping[str, Any], rng: np.random.Generator, change: Callable[[], str], everything: bool = False
) -> Any:
    """A value that fits a JSON Schema; strings with a pattern are changes of a parameter."""
    if "enum" in schema:
        return schema["enum"][int(rng.integers(len(schema["enum"])))]
    kind = schema.get("type")
    if kind == "object":
        properties: Mapping[str, Any] = schema.get("properties", {})
        required = set(schema.get("required", ()))
        chosen = [name for name in properties if everything or name in required or rng.random() < 0.5]
        chosen = chosen or list(properties)[:1]
        return {name: _fill(properties[name], rng, change, everything) for name in chosen}
    if kind == "array":
        count = int(schema.get("maxItems", 3)) if everything else int(rng.integers(1, schema.get("maxItems", 3) + 1))
        return [_fill(schema.get("items", {}), rng, change, everything) for _ in range(count)]
    if kind == "integer":
        return int(rng.integers(schema.get("minimum", 0), schema.get("maximum", 20) + 1))
    if kind == "string":
        return change() if "pattern" in schema else "no reason"
    return None
