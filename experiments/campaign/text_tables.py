"""Tables as Markdown and as LaTeX: heads, and rows of texts or of values with their formats."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from string import Formatter
from typing import Any

from .summary import Statistic, statistic

Emphasis = int | None
"""Rank of an entry: 0 the best, bold; 1 the second, underlined."""

Entry = str | Callable[[Any], str]
"""How an entry is made of a row: ``"{mape:brief} %"``, or a function where more is to be said."""


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> str:
    """A Markdown table whose columns after the first ``text_columns`` are numbers."""
    ruler = ["---"] * text_columns + ["---:"] * (len(heads) - text_columns)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ruler, *rows))


def table_of(rows: Iterable[Any], columns: Mapping[str, Entry], text_columns: int = 1) -> str:
    """A Markdown table with a line for each row and the entries by their heads; see `markdown_table`."""
    return markdown_table(list(columns), entries_of(rows, columns), text_columns)


def entries_of(rows: Iterable[Any], columns: Mapping[str, Entry]) -> list[list[str]]:
    """The texts of a table; a row is a mapping, or an object with attributes."""
    return [[_entry(row, entry) for entry in columns.values()] for row in rows]


def _entry(row: Any, entry: Entry) -> str:
    return entry(row) if callable(entry) else _FORMATTER.vformat(entry, (row,), {})


class _Formatter(Formatter):
    """Format strings of a row's fields.

    They know `brief` as a format, and ``known``: brief, or nothing where there is no number. An empty field of a row,
    which is read as NaN, is an empty text where no format is given.
    """

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """See `string.Formatter`."""
        (row,) = args
        return row[key] if isinstance(row, Mapping) else getattr(row, str(key))

    def format_field(self, value: Any, format_spec: str) -> str:
        """See `string.Formatter`."""
        if format_spec in ("", "known") and value != value:  # only NaN differs from itself
            return ""
        return brief(value) if format_spec in ("brief", "known") else str(super().format_field(value, format_spec))


_FORMATTER = _Formatter()


def brief(value: float) -> str:
    """A number to two or three digits."""
    if math.isnan(value):
        return "–"
    if value == 0:
        return "0"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}" if abs(value) >= 10 else f"{value:.2g}"


def span(values: Sequence[float], form: Callable[[float], str] = brief) -> str:
    """From the smallest to the largest."""
    return f"{form(min(values))} to {form(max(values))}"


def spread(values: Sequence[float] | Statistic) -> str:
    """Mean ± sample standard deviation (n - 1)."""
    found = values if isinstance(values, Statistic) else statistic(values)
    text = brief(found.mean) if math.isnan(found.deviation) else f"{brief(found.mean)} ± {brief(found.deviation)}"
    return f"{text} ({found.missing} without result)" if found.missing else text


def bold(text: str, when: bool = True) -> str:
    """The text, bold where something holds."""
    return f"**{text}**" if when else text


def in_markdown(text: str, rank: Emphasis = None) -> str:
    """An entry by its rank."""
    return f"**{text}**" if rank == 0 else f"<u>{text}</u>" if rank == 1 else text


def latex_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A LaTeX table (booktabs) under a comment with its title."""
    lines = [
        f"% {title}",
        rf"\begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}",
        r"\toprule",
        rf"{' & '.join(escaped(head) for head in heads)} \\",
        r"\midrule",
        *(rf"{' & '.join([escaped(first), *rest])} \\" for first, *rest in rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines)


def in_latex(text: str, rank: Emphasis = None) -> str:
    """An entry by its rank."""
    text = text.replace(" ± ", r" $\pm$ ").replace("–", "--")
    return rf"\textbf{{{text}}}" if rank == 0 else rf"\underline{{{text}}}" if rank == 1 else text


def escaped(text: str) -> str:
    """A text as LaTeX shows it."""
    for character in "&%#_":
        text = text.replace(character, f"\\{character}")
    return text.replace(" · ", r" $\cdot$ ")
