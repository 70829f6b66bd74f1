"""Rewrites a schema into the subset that hosted models enforce strictly."""

import json
from collections.abc import Mapping
from typing import Any

from ..core.json_object import json_object
from ..core.messages import JsonSchema, without_alternatives

# OpenAI's structured outputs refuse these; a reply is checked against them by the proposer anyway.
_UNSUPPORTED = {"minLength", "maxLength", "minProperties", "maxProperties", "default", "examples", "title", "$schema"}


def strict(schema: JsonSchema) -> dict[str, Any]:
    """The schema with every property required and optional ones nullable, as OpenAI's strict mode demands.

    See https://platform.openai.com/docs/guides/structured-outputs, "Supported schemas".
    """
    properties = schema.get("properties")
    if isinstance(properties, Mapping):
        schema = without_alternatives(schema)  # the root of a strict schema must have none
    result = {key: _inner(value) for key, value in schema.items() if key not in _UNSUPPORTED}
    if isinstance(properties, Mapping):
        required = set(schema.get("required", ()))
        # A property may itself be named like a keyword, so properties are rewritten one by one.
        result["properties"] = {
            name: strict(inner) if name in required else {"anyOf": [strict(inner), {"type": "null"}]}
            for name, inner in properties.items()
        }
        result["required"] = list(properties)
        result["additionalProperties"] = False
    return result


def _inner(value: Any) -> Any:
    if isinstance(value, Mapping):
        return strict(value)
    if isinstance(value, list):
        return [_inner(item) for item in value]
    return value


def without_nulls(text: str) -> str:
    """A reply to a strict schema without the optional properties that it left null."""
    content = json_object(text)
    return text if content is None else json.dumps(_prune(content), ensure_ascii=False)


def _prune(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _prune(inner) for key, inner in value.items() if inner is not None}
    return value
