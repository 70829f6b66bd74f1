"""Holds a model in this process to a JSON Schema, token by token, whatever it would rather say."""

import json
from collections.abc import Mapping
from typing import Any

from ..core.messages import ALTERNATIVES, JsonSchema
from .loaded_model import LoadedModel

# Where a schema sets no limit of its own: strings and lists leave no room to ramble.
_MAX_STRING_CHARS = 1200
_MAX_ITEMS = 32
# A changed value and its punctuation, in tokens of one character.
_TOKENS_PER_VALUE = 24


def closed(schema: JsonSchema) -> dict[str, Any]:
    """The schema without room to ramble: strings and lists bounded, unnamed properties forbidden."""
    result = dict(schema)
    if result.get("type") == "string" and "enum" not in result and "pattern" not in result:
        result.setdefault("maxLength", _MAX_STRING_CHARS)
    if result.get("type") == "array":
        result.setdefault("maxItems", _MAX_ITEMS)
        if isinstance(result.get("items"), Mapping):
            result["items"] = closed(result["items"])
    if isinstance(result.get("properties"), Mapping):
        result.setdefault("additionalProperties", False)
        result["properties"] = {name: closed(inner) for name, inner in result["properties"].items()}
    if ALTERNATIVES in result:
        result[ALTERNATIVES] = [closed(inner) for inner in result[ALTERNATIVES]]
    return result


class SchemaProcessor:
    """A logits processor that allows only what the schema allows, and ends in time.

    When the tokens run out it takes the shortest way to the end of the object: a reply is never cut in the middle. The
    model's `grammar_tokenizer` must not be None. Raises `ValueError` if the schema holds something that cannot be
    enforced.
    """

    def __init__(self, loaded: LoadedModel, schema: JsonSchema, prompt_tokens: int, reply_tokens: int) -> None:
        import llguidance
        from llguidance.torch import allocate_token_bitmask

        bounded = closed(schema)
        # Blanks are free in JSON: a weak model would spend its whole reply on them.
        grammar = llguidance.LLMatcher.grammar_from_json_schema(bounded, defaults={"whitespace_flexible": False})
        tokenizer = loaded.grammar_tokenizer
        self._matcher = llguidance.LLMatcher(tokenizer, grammar)
        if self._matcher.is_error():
            raise ValueError(self._matcher.get_error())
        self._mask = allocate_token_bitmask(1, tokenizer.vocab_size)
        self._seen = prompt_tokens
        self._end = prompt_tokens + reply_tokens
        self._ends = loaded.end_tokens
        self._hasten_from = self._end - min(reply_tokens // 2, _tokens_to_close(bounded))
        # In this order the shortest way out: stop, end the string, end the object or list.
        self._ways_out = [*self._ends, *_single_tokens(loaded.tokenizer, ('"', "}", "]"))]

    def __call__(self, input_ids: Any, scores: Any) -> Any:
        """Forbid what does not fit; ``input_ids`` has shape (1, n), ``scores`` (1, vocabulary)."""
        import torch
        from llguidance.torch import fill_next_token_bitmask

        for token in input_ids[0, self._seen :].tolist():
            self._matcher.consume_token(token)
        self._seen = input_ids.shape[1]
        if self._matcher.is_stopped():
            return self._only(scores, self._ends[0]) if self._ends else scores
        fill_next_token_bitmask(self._matcher, self._mask)
        words = self._mask[0].to(scores.device)
        bits = (words.unsqueeze(1) >> torch.arange(32, device=scores.device, dtype=torch.int32)) & 1
        allowed = bits.flatten()[: scores.shape[1]].bool()
        if self._seen >= self._hasten_from:
            for token in self._ways_out:
                if allowed[token]:
                    return self._only(scores, token)
        return scores.masked_fill(~allowed, float("-inf"))

    @staticmethod
    def _only(scores: Any, token: int) -> Any:
        forced = scores.new_full(scores.shape, float("-inf"))
        forced[0, token] = 0.0
        return forced


def _tokens_to_close(schema: JsonSchema) -> int:
    """Tokens that the shortest object with every property could take."""
    properties = schema.get("properties")
    if not isinstance(properties, Mapping):
        return _TOKENS_PER_VALUE
    return sum(
        len(json.dumps(name)) + _TOKENS_PER_VALUE + _tokens_to_close(inner) for name, inner in properties.items()
    )


def _single_tokens(tokenizer: Any, characters: tuple[str, ...]) -> list[int]:
    encoded = [tokenizer.encode(character, add_special_tokens=False) for character in characters]
    return [tokens[0] for tokens in encoded if len(tokens) == 1]
