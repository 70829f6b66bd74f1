"""Tables as Markdown and as LaTeX: heads, and rows of texts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Emphasis = int | None
"""Rank of an entry: 0 the best, bold; 1 the second, underlined."""


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> str:
    """A Markdown table whose columns after the first ``text_columns`` are numbers."""
    ruler = ["---"] * text_columns + ["---:"] * (len(heads) - text_columns)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ruler, *rows))


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
