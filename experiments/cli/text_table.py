"""Tables of text on standard output."""

import shutil
import sys
import textwrap
from collections.abc import Sequence

from ...core.printable import one_line

_INDENT = "  "
_UNDER_NAME = 6
"""Columns by which a text is indented that stands under its name."""


def print_table(title: str, rows: Sequence[tuple[str, ...]]) -> None:
    """A title and rows in columns, one line each; nothing where there are no rows."""
    if not rows:
        return
    print(f"\n{title}")
    cells = [[one_line(cell, 400) for cell in row] for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(*cells, strict=True)]
    for row in cells:
        line = "  ".join(f"{cell:{width}s}" for cell, width in zip(row, widths, strict=True))
        print(f"{_INDENT}{line}".rstrip())


def print_wrapped(title: str, rows: Sequence[tuple[str, str, str]], width: int | None = None) -> None:
    """Names with a text and a remark, which may be empty; as `print_table`, but broken to the width of a terminal.

    ``width`` is that of the terminal at standard output; where there is none, each row is one line, as programs read
    them.
    """
    if width is None and sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
    longest = max((len(name) for name, _, _ in rows), default=0)
    room = 0 if width is None else width - len(_INDENT) - longest - 2
    texts = [f"{text} ({remark})" if remark else text for _, text, remark in rows]
    if width is None or all(len(text) <= room for text in texts):
        print_table(title, [(name, text) for (name, _, _), text in zip(rows, texts, strict=True)])
        return
    print(f"\n{title}")
    beside = room >= width // 2
    hanging = " " * (len(_INDENT) + longest + 2 if beside else _UNDER_NAME)
    for (name, _, _), text in zip(rows, texts, strict=True):
        first = f"{_INDENT}{one_line(name):{longest}s}  " if beside else hanging
        if not beside:
            print(f"{_INDENT}{one_line(name)}")
        lines = textwrap.wrap(
            one_line(text, 400), width, initial_indent=first, subsequent_indent=hanging, break_on_hyphens=False
        )
        print("\n".join(lines))
