"""Takes keys out of any text that could reach a screen, a journal or a report."""

import base64
import json
import os
import re
from collections.abc import Iterator
from urllib.parse import quote, unquote, urlsplit

_SECRET_NAME = re.compile(r"(KEY|TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIALS?)$", re.IGNORECASE)
_KEY_NAME = re.compile(r"(API_KEY|_TOKEN|PASSWORD|PASSWD)$", re.IGNORECASE)
_PLAIN_WORD_CHARS = 8
"""Shorter values are taken out as whole words only, since they could be part of any word."""
# What keys look like, for those that stand elsewhere than in the environment.
_SECRET_SHAPE = re.compile(
    r"(?<=Bearer )[^\s\"',()\[\]{}<>]{8,}"
    r"|\b(?:sk|pk|gsk|hf|xai|tgp|fw)[-_][A-Za-z0-9_\-]{12,}"
    # User name and password of an address; a password may hold a slash or an @ by mistake. Of limited length: a search
    # for an @ that never comes would take the square of the text's length.
    r"|(?<=://)(?:[^\s\"'<>/]{1,512}|[^\s\"'<>/@:]{0,256}:[^\s\"'<>]{1,512})(?=@)"
)
REDACTED = "[redacted]"


def redact(text: str) -> str:
    """The text without the values of the environment's keys, and without anything shaped like a key.

    Texts are to be redacted before they are cut: half a key is not recognised.
    """
    return _SECRET_SHAPE.sub(REDACTED, _without_values(text))


def holds_key(text: str) -> bool:
    """Whether the text holds the value of one of the environment's keys."""
    return _without_values(text) != text


def _without_values(text: str) -> str:
    for secret in sorted(set(_secrets()), key=len, reverse=True):
        if secret not in text:
            continue
        if len(secret) >= _PLAIN_WORD_CHARS:
            text = text.replace(secret, REDACTED)
        else:
            text = re.sub(rf"(?<![A-Za-z0-9]){re.escape(secret)}(?![A-Za-z0-9])", REDACTED, text)
    return text


def _secrets() -> Iterator[str]:
    """Every value that must not be shown, in each spelling in which it could come back."""
    for name, value in os.environ.items():
        value = value.strip()
        # A short value of a variable that is only named like a secret (ENABLE_KEY=on) is a word like any other.
        if value and (_KEY_NAME.search(name) or (len(value) >= _PLAIN_WORD_CHARS and _SECRET_NAME.search(name))):
            yield from _spellings(value)
        if "://" in value and "@" in value:
            yield from _login(value)


def _spellings(secret: str) -> Iterator[str]:
    yield from (secret, json.dumps(secret)[1:-1], quote(secret, safe=""))


def _login(address: str) -> Iterator[str]:
    """The password of an address, and the header that it is sent in."""
    try:
        parts = urlsplit(address)
    except ValueError:
        return
    if parts.password:
        yield from _spellings(parts.password)
        yield from _spellings(unquote(parts.password))
        yield base64.b64encode(f"{unquote(parts.username or '')}:{unquote(parts.password)}".encode()).decode()
