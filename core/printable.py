"""Text for messages: what comes from outside the program made printable, and numbers and nouns put together."""

import re
from collections.abc import Iterable

_ESCAPE_SEQUENCE = re.compile(
    r"\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)?"  # operating-system commands: titles, links, clipboard
    r"|[\x1b\x9b]\[?[0-?]*[ -/]*[@-~]"  # cursor, colour and mode sequences
)
# C0 and C1 controls except tab and newline, bidirectional overrides, and lone surrogates.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def shown(text: object, limit: int = 60) -> str:
    """The text on one line, control characters escaped and long texts cut, fit for a message."""
    printable = "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in str(text)[: 4 * limit]
    )
    return printable if len(printable) <= limit else printable[: limit - 3] + "..."


def strip_control(text: str) -> str:
    """Remove what could steer a terminal or disguise text: escape sequences, control codes, direction overrides.

    Tabs and newlines stay; lone surrogates, which no file can hold, go.
    """
    return _CONTROL.sub("", _ESCAPE_SEQUENCE.sub("", text.replace("\r\n", "\n").replace("\r", "\n")))


def one_line(text: str, limit: int = 200) -> str:
    """A model's or a plugin's words on one line, without what could steer a terminal, cut where they are long."""
    line = " ".join(strip_control(text).split())
    return line if len(line) <= limit else line[: limit - 1] + "…"


def described(value: object) -> str:
    """What Python writes for a value, as `shown`; its type where the value's own code fails at that."""
    try:
        return shown(repr(value))
    except Exception:  # a plugin's code, perhaps
        return type(value).__name__


def listed(names: Iterable[object], limit: int = 20) -> str:
    """Names in quotes, the first ``limit`` of them."""
    everything = [f'"{shown(name, 40)}"' for name in names]
    more = f" and {len(everything) - limit} more" if len(everything) > limit else ""
    return ", ".join(everything[:limit]) + more


def counted(count: int, noun: str, ending: str = "s") -> str:
    """A number of things: ``1 gap``, ``2 gaps``; ``ending`` is that of the plural."""
    return f"{count} {noun}{ending * (count != 1)}"


def rounded(value: float, digits: int, sign: bool = False) -> str:
    """A number of so many digits, large ones written out: ``"520"``, ``"7,403,110"``, never ``"5.2e+02"``."""
    plus = "+" if sign else ""
    text = f"{value:{plus}.{digits}g}"
    return f"{float(text):{plus},.0f}" if "e+" in text else text


def were(count: int) -> str:
    """The verb after a number of things."""
    return "was" if count == 1 else "were"


def with_article(noun: object) -> str:
    """``"a float"``, ``"an int"``: a noun, or a type's name, behind the article that its first letter asks for."""
    text = shown(noun)
    return f"{'an' if text[:1].lower() in 'aeio' or text.startswith('ndarray') else 'a'} {text}"


def duration(seconds: float) -> str:
    """A time as a person says it: ``about 2 min``."""
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"
