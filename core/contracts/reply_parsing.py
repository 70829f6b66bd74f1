"""Reads a model's reply, which is untrusted text, into one JSON object. Nothing is ever evaluated."""

import json
import math
import re
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from ..errors import BsaError

MAX_REPLY_CHARS = 200_000
"""Longer replies are refused unread: no proposal needs a tenth of this."""

_MAX_DEPTH = 32
# These two bound the work on hostile text, where every brace may promise an object up to the end of the reply.
_MAX_STARTS = 200
_MAX_PASSES = 5

_END_OF_THOUGHTS = "</think>"
_NUMBER = re.compile(r"-?[0-9]{1,300}(?:\.[0-9]{0,300})?(?:[eE][+-]?[0-9]{1,4})?")
_BLANK = re.compile(r"(?:\s|/\*.*?(?:\*/|\Z)|(?://|#)[^\n]*)*+", re.DOTALL)  # White space and comments.
_BARE_KEY = re.compile(r'[^:,{}\[\]"\n]*')
_BARE_VALUE = re.compile(r"(?:(?!//|/\*| #)[^,{}\[\]\n])*+")
_AFTER_STRING = re.compile(r"[^\S\n]*+(?:\Z|[\n,:}\]#]|//|/\*)")
"""What follows a string. A quote at the end of a line closes its string even where the comma was forgotten."""
_QUOTES = {'"': '"', "'": "'", "“": "”", "`": "`"}
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f"}
_WORDS = {"true": True, "True": True, "false": False, "False": False, "null": None, "None": None}


def parse_object(text: str, keys: Iterable[str] = ()) -> dict[str, Any]:
    """The JSON object in a reply, repaired where the meaning is plain.

    Prose and code fences around the object, comments, trailing or missing commas, single quotes, unquoted keys and
    values (``{"x": *1.2}``), raw newlines and quotes in strings, and a missing end are tolerated. Values keep the type
    they were written with: judging them is the caller's part. Among several objects the one with most of ``keys`` is
    taken; among equals a complete one, and then the last, since models conclude with their answer. Raises `BsaError` if
    there is no object, or the reply is longer than `MAX_REPLY_CHARS`.
    """
    if len(text) > MAX_REPLY_CHARS:
        raise BsaError(
            f"the reply has {len(text)} characters, more than the {MAX_REPLY_CHARS} that are read.",
            "answer with one short JSON object.",
        )
    wanted = set(keys)
    # The object may stand inside the thoughts of a model that forgot to answer; so both are tried.
    for part in dict.fromkeys((text.rpartition(_END_OF_THOUGHTS)[2], text)):
        found = _objects(part)
        if found:
            best: tuple[dict[str, Any], bool] = max(
                reversed(found), key=lambda pair: (len(wanted & pair[0].keys()), pair[1])
            )
            return best[0]
    raise BsaError(
        "the reply is empty." if not text.strip() else "the reply holds no JSON object.",
        "answer with one JSON object and nothing else.",
    )


class _NotAnObjectError(Exception):
    """The text at this place does not read as JSON, however kindly."""


def _objects(text: str) -> list[tuple[dict[str, Any], bool]]:
    """Every outermost object in the text, in order, and whether it is complete."""
    found: list[tuple[dict[str, Any], bool]] = []
    work_left = _MAX_PASSES * len(text)
    position = text.find("{")
    for _ in range(_MAX_STARTS):
        if position < 0 or work_left <= 0:
            break
        try:
            value, end = _STRICT.raw_decode(text, position)
            found.append((_clean(value), True))
        except (ValueError, RecursionError):
            end = position + 1
            reader = _KindReader(text, position)
            with suppress(_NotAnObjectError):
                value = reader.read_object(0)
                found.append((value, reader.complete))
                end = reader.position
            work_left -= reader.position - position
        position = text.find("{", end)
    return found


def _number(literal: str) -> int | float | str:
    """The number; or the text itself where it is not finite or too long to be meant."""
    if len(literal) > 330:
        return literal[:330]
    try:
        return int(literal)
    except ValueError:
        value = float(literal)
        return value if math.isfinite(value) else literal


_STRICT = json.JSONDecoder(parse_int=_number, parse_float=_number, parse_constant=str, strict=False)


def _clean(value: Any) -> Any:
    """The value with pairs of surrogates joined, and without lone ones, which could not be written to a journal."""
    if isinstance(value, str):
        return value.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
    if isinstance(value, list):
        return [_clean(item) for item in value]
    if isinstance(value, dict):
        return {_clean(key): _clean(item) for key, item in value.items()}
    return value


class _KindReader:
    """Reads JSON as people and small models write it.

    The libraries for this lose what a change means: ``json_repair`` reads ``*1.2`` and ``+0.02`` as plain numbers.

    ``position`` is the next character to be read; ``complete`` is False once the text ended too early and open strings,
    lists and objects were closed for it.
    """

    def __init__(self, text: str, position: int) -> None:
        self.text = text
        self.position = position
        self.complete = True

    def read_object(self, depth: int) -> dict[str, Any]:
        """Read from an opening brace to its match."""
        result: dict[str, Any] = {}
        self.position += 1
        while not self._closes("}"):
            if self._next() == ",":
                self.position += 1
                continue
            key = self._read_key()
            if self._next() != ":":
                if self._at_end() and result:
                    break
                raise _NotAnObjectError
            self.position += 1
            if self._at_end():
                self.complete = False
                break
            result[key] = self._read_value(depth)
        if not self.complete and not result:
            raise _NotAnObjectError
        return result

    def _read_array(self, depth: int) -> list[Any]:
        result: list[Any] = []
        self.position += 1
        while not self._closes("]"):
            if self._next() == ",":
                self.position += 1
                continue
            result.append(self._read_value(depth))
        return result

    def _read_value(self, depth: int) -> Any:
        character = self._next()
        if character in ("{", "["):
            if depth >= _MAX_DEPTH:
                raise _NotAnObjectError
            return self.read_object(depth + 1) if character == "{" else self._read_array(depth + 1)
        if character in _QUOTES:
            return self._read_string()
        return self._read_bare_value()

    def _read_key(self) -> str:
        if self._next() in _QUOTES:
            return self._read_string()
        return self._read_bare(_BARE_KEY)

    def _read_bare_value(self) -> Any:
        word = self._read_bare(_BARE_VALUE)
        if word in _WORDS:
            return _WORDS[word]
        return _number(word) if _NUMBER.fullmatch(word) else _clean(word)

    def _read_bare(self, form: re.Pattern[str]) -> str:
        """Text without quotes."""
        text = self._take(form).strip()
        if not text:
            raise _NotAnObjectError
        return text

    def _take(self, form: re.Pattern[str]) -> str:
        """The text that has this form from here on, which may be none; it is passed over."""
        match = form.match(self.text, self.position)
        assert match is not None  # all three forms match the empty text
        self.position = match.end()
        return match[0]

    def _read_string(self) -> str:
        opening = self.text[self.position]
        closing = _QUOTES[opening]
        self.position += 1
        pieces: list[str] = []
        while self.position < len(self.text):
            character = self.text[self.position]
            self.position += 1
            if character == "\\":
                pieces.append(self._read_escape())
            elif character in (closing, opening) and self._ends_string():
                return _clean("".join(pieces))  # type: ignore[no-any-return]
            else:
                pieces.append(character)
        self.complete = False
        return _clean("".join(pieces))  # type: ignore[no-any-return]

    def _read_escape(self) -> str:
        character = self.text[self.position : self.position + 1]
        self.position += 1
        if character == "u":
            digits = self.text[self.position : self.position + 4]
            if re.fullmatch(r"[0-9a-fA-F]{4}", digits):
                self.position += 4
                return chr(int(digits, 16))
        return _ESCAPES.get(character, character)

    def _ends_string(self) -> bool:
        """Whether the quote just read closes its string, rather than being an unescaped quote within it."""
        return _AFTER_STRING.match(self.text, self.position) is not None

    def _closes(self, closing: str) -> bool:
        if self._at_end():
            self.complete = False
            return True
        if self.text[self.position] == closing:
            self.position += 1
            return True
        if self.text[self.position] in "}]":
            raise _NotAnObjectError
        return False

    def _at_end(self) -> bool:
        return self._next() == ""

    def _next(self) -> str:
        """The next character that is neither blank nor part of a comment; empty at the end."""
        self._take(_BLANK)
        return self.text[self.position : self.position + 1]
