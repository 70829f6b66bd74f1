"""Gets one JSON object out of any server: by tools or a schema, else by JSON mode, else by words in the prompt."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from ..core.json_object import json_object
from ..core.messages import JsonSchema, Message, StructuredBy, Usage, without_alternatives

T = TypeVar("T")

LADDER: tuple[StructuredBy, ...] = ("tools", "schema", "json", "text")
_accepted: dict[str, StructuredBy] = {}
"""What each server took last, for the life of the process: a refusal costs a round trip only once."""


class FormRefusedError(Exception):
    """The server does not take this form of request.

    Only where it said so, rather than failing over it, is that ``certain`` and remembered. ``usage`` is what an answer
    cost that did not keep to the form.
    """

    def __init__(self, reason: str, certain: bool = True, usage: Usage | None = None) -> None:
        super().__init__(reason)
        self.certain = certain
        self.usage = usage or Usage()


def descend(
    server: str, ask: Callable[[StructuredBy], T], notes: list[str], first: StructuredBy = "schema"
) -> tuple[T, StructuredBy]:
    """Ask in the strictest form that the server takes, ``first`` being the strictest one worth trying.

    Refusals are remembered by ``server``: route, address and model. ``ask`` asks in the given form; raises
    `FormRefusedError`, as this does if even plain text is refused: then the form was not the reason, and nothing is
    remembered.
    """
    start = max(LADDER.index(first), LADDER.index(_accepted.get(server, first)))
    refusals: list[str] = []
    certain = True
    for form in LADDER[start:]:
        try:
            result = ask(form)
        except FormRefusedError as refusal:
            if form == "text":
                raise
            certain = certain and refusal.certain
            refusals.append(f"the server refused {_NAMES[form]} ({refusal})")
            continue
        if refusals and certain:
            _accepted[server] = form
        notes.extend(refusals)
        return result, form
    raise AssertionError("the last form returns or raises")


_NAMES: dict[StructuredBy, str] = {
    "tools": "tools",
    "schema": "a JSON schema",
    "json": "JSON mode",
    "text": "plain text",
}

_CALL = "Answer by calling the tool of what you choose, once; its arguments are the JSON object."


def shortened(schema: JsonSchema, chars: int) -> dict[str, Any]:
    """The schema with free text of at most so many characters in each string."""
    result = {key: _shortened(value, chars) for key, value in schema.items()}
    if schema.get("type") == "string" and "maxLength" in schema and not {"enum", "pattern"} & set(schema):
        result["maxLength"] = min(schema["maxLength"], chars)
    return result


def _shortened(value: Any, chars: int) -> Any:
    if isinstance(value, Mapping):
        return shortened(value, chars)
    return [_shortened(item, chars) for item in value] if isinstance(value, list) else value


def with_schema_in_prompt(messages: Sequence[Message], schema: JsonSchema, form: StructuredBy) -> list[Message]:
    """The conversation, which says itself what is wanted where the server does not enforce it."""
    messages = list(messages)
    if form == "schema" or not messages:
        return messages
    if form == "tools":
        return [*messages[:-1], replace(messages[-1], text=f"{messages[-1].text}\n\n{_CALL}")]
    wanted = json.dumps(without_alternatives(schema), ensure_ascii=False, separators=(",", ":"))
    text = (
        f"{messages[-1].text}\n\nAnswer with one JSON object and nothing else, without code fences or comments. "
        f"It must satisfy this JSON Schema:\n{wanted}"
    )
    return [*messages[:-1], replace(messages[-1], text=text)]


def held_by(form: StructuredBy, text: str, schema: JsonSchema) -> StructuredBy:
    """The form that truly held the reply: some servers accept a schema and ignore it."""
    content = json_object(text)
    if form == "text" or content is None:
        return "text"
    return form if form == "json" or set(schema.get("required", ())) <= content.keys() else "json"
