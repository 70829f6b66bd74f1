"""Tables of a grid in the paper's form, as Markdown and LaTeX: mean ± std, best bold, second underlined."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import BsaError, did_you_mean
from ...core.files import begins, entries, foreign, write_text
from ...core.signal_metrics import MISFIT
from ..studies.table import Statistic, ranks, statistic
from .results import Row, grid_folder, read_manifest, rows_of, write_rows
from .statistics import Comparison, compare
from .store import Store

METRICS = {"mape": "total MAPE, %", "rmse": "total RMSE", "v_rmse_mv": "voltage RMSE, mV"}
"""The errors of cells."""

OF_NO_CELL = {"objective": f"{MISFIT.label}, {MISFIT.unit}"}
"""The error of tasks that are no cells."""
RESULTS = Path("results")

EFFORT = ("simulations", "failed_simulations", "llm_calls", "tokens", "cost_usd", "wall_s")

Mark = Callable[[str, int | None], str]
"""How a value is shown by its rank: 0 best, 1 second, None neither."""


@dataclass(frozen=True)
class Block:
    """A table: a row a method, a column a chemistry.

    Attributes
    ----------
    title : str
        What stands over it.
    columns : tuple of str
        Heads, without the first.
    rows : tuple of (str, tuple of (Statistic or None))
        By method.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Statistic | None, ...]], ...]

    def ranks(self, column: int) -> dict[str, int]:
        """Places of the methods in a column, 0 the best; methods without a result have none."""
        entries = {method: row[column] for method, row in self.rows}
        means = {method: entry.mean for method, entry in entries.items() if entry is not None}
        return ranks(means) if len(self.rows) > 1 else {}


def tables(grid: str | Path, store: Path = RESULTS, out: Path | None = None, metric: str = "mape") -> list[Path]:
    """Write the tables and figures of a grid: ``bsa bench tables``.

    Parameters
    ----------
    grid : str or Path
        Name, file or folder of a grid that was run, finished or not.
    store : Path
        The store that it was run in.
    out : Path, optional
        Where to write; the grid's folder by default.
    metric : str
        The error that is compared and drawn; the tables show all of `shown_metrics`.

    Returns
    -------
    list of Path
        What was written: ``cells.csv``, ``cells.parquet`` where pyarrow is installed, ``tables.md``,
        ``tables.tex`` and figures as SVG.

    Raises
    ------
    BsaError
        If the grid has not been run in this store, or there is no such error.
    """
    from .figures import draw_all

    check_metric(metric)
    place = Store(store)
    folder = grid_folder(grid, place)
    manifest = read_manifest(folder)
    rows = rows_of(manifest, place)
    metric = compared_metric(rows, metric)
    if out is None:
        out = folder
    elif entries(out) and not begins(out / "cells.csv", b"grid,task,mode,"):
        raise foreign(out, "tables of a grid")
    write_rows(rows, out)
    reference = reference_of(manifest["grid"].get("reference"), manifest["methods"])
    write_text(out / "tables.md", markdown(rows, reference, metric))
    write_text(out / "tables.tex", latex(rows, reference, metric))
    for name, svg in draw_all(rows, place, metric).items():
        write_text(out / f"{name}.svg", svg)
    return sorted(path for path in out.iterdir() if path.suffix in (".md", ".tex", ".svg", ".csv", ".parquet"))


def check_metric(metric: str) -> None:
    """Whether an error may be compared and drawn.

    Raises
    ------
    BsaError
        If there is no such error, with the nearest one.
    """
    if metric not in METRICS:
        raise BsaError(
            f'there is no error "{metric}".', did_you_mean(metric, METRICS) or f"choose one of {', '.join(METRICS)}."
        )


def shown_metrics(rows: Sequence[Row]) -> dict[str, str]:
    """The errors that tables show, by name: those of cells, or the objective where no task is one."""
    found = {name for name in (*METRICS, *OF_NO_CELL) for row in rows if row.get(name) is not None}
    return OF_NO_CELL if found == set(OF_NO_CELL) else METRICS


def compared_metric(rows: Sequence[Row], metric: str) -> str:
    """The error that is compared: the one asked for, if these tasks have it."""
    return metric if metric in shown_metrics(rows) else next(iter(shown_metrics(rows)))


def label_of(metric: str) -> str:
    """An error as tables call it."""
    return {**METRICS, **OF_NO_CELL}.get(metric, metric)


def reference_of(wanted: str | None, methods: Sequence[str]) -> str:
    """The method that others are compared with: the one named, whole or by its scaffold, else the first."""
    return next((method for method in methods if wanted and method.split(" · ")[0] == wanted), methods[0])


def blocks(rows: Sequence[Row], metric: str) -> list[Block]:
    """One table a mode, with a last column over all chemistries where there are several."""
    found = []
    for mode in dict.fromkeys(row["mode"] for row in rows):
        mine = [row for row in rows if row["mode"] == mode]
        chemistries = list(dict.fromkeys(row["chemistry"] for row in mine))
        columns = [[chemistry] for chemistry in chemistries] + ([chemistries] if len(chemistries) > 1 else [])
        found.append(
            Block(
                f"{mode}, {label_of(metric)}",
                (*chemistries, "all") if len(chemistries) > 1 else tuple(chemistries),
                tuple(
                    (method, tuple(_statistic(mine, method, column, metric) for column in columns))
                    for method in dict.fromkeys(row["method"] for row in mine)
                ),
            )
        )
    return found


def _statistic(rows: Sequence[Row], method: str, chemistries: Sequence[str], metric: str) -> Statistic | None:
    values = [
        math.nan if row[metric] is None else float(row[metric])
        for row in rows
        if row["method"] == method and row["chemistry"] in chemistries
    ]
    return statistic(values) if values else None


def markdown(rows: Sequence[Row], reference: str, metric: str = "mape") -> str:
    """All tables as Markdown, and the comparisons behind them."""
    parts = [_coverage(rows)]
    for name in shown_metrics(rows):
        parts += [_markdown_block(block) for block in blocks(rows, name)]
    parts += [_markdown_comparisons(compare(rows, reference, metric), metric), _markdown_effort(rows)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _coverage(rows: Sequence[Row]) -> str:
    done = sum(row["state"] == "done" for row in rows)
    tasks, seeds = len({row["task"] for row in rows}), len({row["seed"] for row in rows})
    missing = f", {len(rows) - done} without a result" if done < len(rows) else ""
    return (
        f"{len(rows)} cells: {tasks} tasks, {seeds} seed{'s' * (seeds > 1)}{missing}. "
        "Mean ± standard deviation over cells; best bold, second underlined."
    )


def _markdown_block(block: Block) -> str:
    ranks = [block.ranks(column) for column in range(len(block.columns))]
    lines = [f"**{block.title}**", "", f"| method | {' | '.join(block.columns)} | cells |"]
    lines.append("|" + " --- |" * (len(block.columns) + 2))
    for method, row in block.rows:
        entries = [_entry(value, rank.get(method), _in_markdown) for value, rank in zip(row, ranks, strict=True)]
        lines.append(f"| {method} | {' | '.join(entries)} | {_counts(row)} |")
    return "\n".join(lines)


def _counts(row: Sequence[Statistic | None]) -> str:
    known = [value for value in row if value is not None]
    last = known[-1:] if len(row) > 1 else known
    return str(sum(value.count for value in last))


def _entry(value: Statistic | None, rank: int | None, mark: Mark) -> str:
    if value is None:
        return "–"
    text = mark(_mean(value), rank)
    return f"{text} ({value.missing} without result)" if value.missing else text


def _mean(value: Statistic) -> str:
    spread = "" if math.isnan(value.deviation) else f" ± {_short(value.deviation)}"
    return f"{_short(value.mean)}{spread}"


def _short(value: float) -> str:
    if math.isnan(value):
        return "–"
    return f"{value:.2f}" if 0.1 <= value < 1000 or value == 0 else f"{value:.3g}"


def _in_markdown(text: str, rank: int | None) -> str:
    return f"**{text}**" if rank == 0 else f"<u>{text}</u>" if rank == 1 else text


def _in_latex(text: str, rank: int | None) -> str:
    text = text.replace(" ± ", r" $\pm$ ").replace("–", "--")
    return rf"\textbf{{{text}}}" if rank == 0 else rf"\underline{{{text}}}" if rank == 1 else text


def _markdown_comparisons(comparisons: Sequence[Comparison], metric: str) -> str:
    if not comparisons:
        return ""
    name, reference = label_of(metric), comparisons[0].reference
    lines = [
        f"**against {reference}** ({name}; ratio of errors, geometric mean over cases, bootstrap 95 % interval; "
        "Wilcoxon signed-rank, Holm-corrected)",
        "",
        "| method | ratio | 95 % interval | cases worse / better / all | p | verdict |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {item.method} | {item.ratio:.3g} | {item.low:.3g} to {item.high:.3g} | "
        f"{item.worse} / {item.better} / {item.cases} | {item.adjusted_p:.2g} | {item.verdict} |"
        for item in comparisons
    ]
    return "\n".join(lines)


def _markdown_effort(rows: Sequence[Row]) -> str:
    heads = ("simulations", "of them failed", "model calls", "tokens", "cost / $", "time / s")
    lines = ["**effort, mean a cell**", "", f"| method | {' | '.join(heads)} |", "|" + " --- |" * (len(heads) + 1)]
    for method, values in effort(rows).items():
        lines.append(f"| {method} | {' | '.join(f'{value:.4g}' for value in values)} |")
    return "\n".join(lines)


def effort(rows: Sequence[Row]) -> dict[str, list[float]]:
    """Means of `EFFORT` by method, finished cells only."""
    done = [row for row in rows if row["state"] == "done"]
    return {
        method: [statistic([float(row[name] or 0) for row in done if row["method"] == method]).mean for name in EFFORT]
        for method in dict.fromkeys(row["method"] for row in done)
    }


def latex(rows: Sequence[Row], reference: str, metric: str = "mape") -> str:
    """All tables as LaTeX (booktabs)."""
    parts = ["% \\usepackage{booktabs}"]
    for name in shown_metrics(rows):
        parts += [_latex_block(block) for block in blocks(rows, name)]
    parts.append(_latex_comparisons(compare(rows, reference, metric), metric))
    return "\n\n".join(part for part in parts if part) + "\n"


def _latex_block(block: Block) -> str:
    ranks = [block.ranks(column) for column in range(len(block.columns))]
    body = [
        [method, *(_entry(value, rank.get(method), _in_latex) for value, rank in zip(row, ranks, strict=True))]
        for method, row in block.rows
    ]
    return _tabular(block.title, ["method", *block.columns], body)


def _latex_comparisons(comparisons: Sequence[Comparison], metric: str) -> str:
    if not comparisons:
        return ""
    body = [
        [
            item.method,
            f"{item.ratio:.3g}",
            f"{item.low:.3g}--{item.high:.3g}",
            f"{item.cases}",
            f"{item.adjusted_p:.2g}",
            item.verdict,
        ]
        for item in comparisons
    ]
    title = f"against {comparisons[0].reference}, {label_of(metric)}"
    return _tabular(title, ["method", "ratio", r"95 % interval", "cases", "$p$", "verdict"], body)


def _tabular(title: str, heads: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    lines = [
        f"% {title}",
        rf"\begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}",
        r"\toprule",
        rf"{' & '.join(_escaped(head) for head in heads)} \\",
        r"\midrule",
        *(rf"{' & '.join([_escaped(first), *(entry for entry in rest)])} \\" for first, *rest in body),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines)


def _escaped(text: str) -> str:
    for character in "&%#_":
        text = text.replace(character, f"\\{character}")
    return text.replace(" · ", r" $\cdot$ ")
