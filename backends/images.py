"""Overlay images for models that can see."""

import base64
from collections.abc import Sequence
from dataclasses import replace

from ..core.messages import Message
from ..core.printable import counted


def showable(messages: Sequence[Message], sees_images: bool, notes: list[str]) -> list[Message]:
    """The conversation with those images only that can be shown."""
    count = sum(len(message.images) for message in messages)
    if count and not sees_images:
        notes.append(f"{counted(count, 'image')} left out: the model cannot see")
        return [replace(message, images=()) for message in messages]
    shown = [replace(message, images=tuple(path for path in message.images if path.is_file())) for message in messages]
    missing = count - sum(len(message.images) for message in shown)
    if missing:
        notes.append(f"{counted(missing, 'image')} left out: no such file")
    return shown


def data_urls(message: Message) -> list[str]:
    """The message's PNG images as ``data:`` addresses."""
    return [f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}" for path in message.images]
