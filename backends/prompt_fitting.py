"""Shortens a prompt that does not fit into a model's context: memories go first, from the top."""

from collections.abc import Sequence
from dataclasses import replace

from ..core.messages import Message
from ..core.prompt_sections import without_first_memory


class ContextTooSmallError(Exception):
    """The prompt does not fit into the model's context."""


def drop_memory(messages: Sequence[Message], notes: list[str]) -> list[Message]:
    """The conversation without its first section headed `MEMORY`, the oldest or least important, which is noted.

    Raises `ContextTooSmallError` if there is none left to drop.
    """
    for place, message in enumerate(messages):
        found = without_first_memory(message.text)
        if found is not None:
            shorter, heading = found
            notes.append(f'the section "{heading}" was left out: the context is too small')
            return [*messages[:place], replace(message, text=shorter), *messages[place + 1 :]]
    raise ContextTooSmallError
