"""A reply as the call of a tool: one tool for each alternative of the schema, and the call as one object again."""

import json
from typing import Any

from ..core.json_object import json_object
from ..core.messages import ALTERNATIVES, JsonSchema
from .strict_schema import strict

_CHOICE = "action"
"""The property whose one value names an alternative, and so its tool."""

_ONLY = "answer"
"""Name of the tool of a schema without alternatives."""


def tools(schema: JsonSchema, strictly: bool) -> list[dict[str, Any]]:
    """The tools that a model may call, as OpenAI's interface describes them.

    ``strictly`` tells parameters in the subset that hosted models enforce.
    """
    return [_tool(own, strictly) for own in schema.get(ALTERNATIVES, (schema,))]


def _tool(schema: JsonSchema, strictly: bool) -> dict[str, Any]:
    properties = dict(schema["properties"])
    names = properties.pop(_CHOICE, {}).get("enum", (_ONLY,))
    required = [name for name in schema.get("required", ()) if name in properties]
    parameters = {**schema, "properties": properties, "required": required}
    function = {"name": names[0], "parameters": strict(parameters) if strictly else parameters}
    return {"type": "function", "function": {**function, "strict": True} if strictly else function}


def as_object(name: str, arguments: str) -> str:
    """A call as the object that the schema describes; arguments that are none stay as they are."""
    content = json_object(arguments or "{}")
    if content is None:
        return arguments
    return json.dumps(content if name == _ONLY else {_CHOICE: name, **content}, ensure_ascii=False)
