"""Text for messages: what nobody vouches for made printable, and numbers and nouns put together."""

from collections.abc import Iterable


def shown(text: object, limit: int = 60) -> str:
    """The text on one line, control characters escaped and long texts cut, fit for a message."""
    printable = "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in str(text)[: 4 * limit]
    )
    return printable if len(printable) <= limit else printable[: limit - 3] + "..."


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


def counted(number: int, noun: str) -> str:
    """``"1 run"``, ``"2 runs"``: a number and its noun, whose plural ends with s."""
    return f"{number} {noun}{'s' * (number != 1)}"


def with_article(noun: object) -> str:
    """``"a float"``, ``"an int"``: a noun, or a type's name, behind the article that its first letter asks for."""
    text = shown(noun)
    return f"{'an' if text[:1].lower() in 'aeio' or text.startswith('ndarray') else 'a'} {text}"
