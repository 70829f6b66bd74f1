"""Tables of a campaign in the paper's form, as Markdown and LaTeX: mean ± std, best bold, second underlined."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ...core.comparison.signal_metrics import MISFIT
from ...core.errors import unknown
from ...core.files import begins, entries, foreign, write_text
from ...core.printable import counted
from ..report.wording import number
from .columns import COLUMNS
from .results import grid_folder, read_manifest, rows_of, store_of, write_rows
from .statistics import Comparison, compare
from .store import Store
from .summary import Row, Statistic, grouped, mean_of, paper_rows, ranks, statistic
from .text_tables import Emphasis, entries_of, in_latex, in_markdown, latex_table, markdown_table, table_of

METRICS = {column.name: column.error for column in COLUMNS if column.error}
"""The errors of cells."""

OF_NO_CELL = {"objective": f"{MISFIT.label}, {MISFIT.unit}"}
"""The error of tasks that are no cells."""

EFFORT = {column.name: column.effort for column in COLUMNS if column.effort}
"""What a run spends, by column."""


@dataclass(frozen=True)
class Block:
    """A table: a row a method, a column a chemistry."""

    title: str  # What stands over it.
    columns: tuple[str, ...]  # Heads, without the first.
    rows: dict[str, tuple[Statistic | None, ...]]  # By method.
    quoted: dict[str, tuple[Statistic | None, ...]]  # The paper's rows, which are not ranked.

    @property
    def ranked(self) -> list[tuple[str, list[tuple[Statistic | None, Emphasis]]]]:
        """The rows with the place of each entry in its column, 0 the best; a method without a result has none."""
        places = [self._ranks(column) for column in range(len(self.columns))]
        return [
            (method, [(value, rank.get(method)) for value, rank in zip(row, places, strict=True)])
            for method, row in self.rows.items()
        ]

    def _ranks(self, column: int) -> dict[str, int]:
        known = {method: row[column] for method, row in self.rows.items()}
        means = {method: entry.mean for method, entry in known.items() if entry is not None}
        return ranks(means) if len(self.rows) > 1 else {}


@dataclass(frozen=True)
class Campaign:
    """A campaign that was run, finished or not, as tables and pages see it."""

    about: dict[str, Any]  # Its name, and how it was made.
    methods: list[str]  # What is compared.
    rows: list[Row]  # The results table.
    store: Store  # Where its cells lie.
    folder: Path  # Where its tables lie.
    metric: str  # The error that is compared and drawn.

    @property
    def reference(self) -> str:
        """The method that others are compared with: the first of the scaffold that is named, else the first."""
        wanted = self.about.get("reference")
        return next((method for method in self.methods if wanted and method.split(" · ")[0] == wanted), self.methods[0])

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """Every method against the reference."""
        return compare(self.rows, self.reference, self.metric)

    @property
    def blocks(self) -> list[Block]:
        """The tables of every error."""
        quoting = bool(self.about.get("paper_rows"))
        return [block for name in shown_metrics(self.rows) for block in blocks(self.rows, name, quoting)]


def open_campaign(grid: str | Path, store: Path, metric: str = "mape") -> Campaign:
    """A campaign that was run.

    ``metric`` is the error that is compared and drawn, if its tasks have it. Raises `BsaError` if it has not been run
    in this store, or there is no such error.
    """
    if metric not in METRICS:
        raise unknown(f'there is no error "{metric}".', metric, METRICS)
    place = store_of(grid, store)
    folder = grid_folder(grid, place)
    manifest = read_manifest(folder)
    rows = rows_of(manifest, place)
    return Campaign(manifest["grid"], manifest["methods"], rows, place, folder, compared_metric(rows, metric))


def tables(grid: str | Path, store: Path, out: Path | None = None, metric: str = "mape") -> list[Path]:
    """Write the tables and figures of a campaign: ``bsa bench tables``.

    They go to the campaign's folder by default, and show all of `shown_metrics`. Gives what was written: ``cells.csv``,
    ``cells.parquet`` where pyarrow is installed, ``tables.md``, ``tables.tex`` and figures as SVG. Raises `BsaError`:
    as `open_campaign`, or if ``out`` holds something else.
    """
    from .figures import draw_all

    campaign = open_campaign(grid, store, metric)
    if out is None:
        out = campaign.folder
    elif entries(out) and not begins(out / "cells.csv", b"grid,task,mode,"):
        raise foreign(out, "tables of a campaign")
    write_rows(campaign.rows, out)
    write_text(out / "tables.md", markdown(campaign))
    write_text(out / "tables.tex", latex(campaign))
    for name, svg in draw_all(campaign.rows, campaign.store, campaign.metric).items():
        write_text(out / f"{name}.svg", svg)
    return sorted(path for path in out.iterdir() if path.suffix in (".md", ".tex", ".svg", ".csv", ".parquet"))


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


def blocks(rows: Sequence[Row], metric: str, quoting: bool = False) -> list[Block]:
    """One table a mode, with a last column over all chemistries where there are several."""
    theirs = paper_rows(metric) if quoting else {}
    found = []
    for mode, own in grouped(rows, "mode").items():
        chemistries = list(grouped(own, "chemistry"))
        several = len(chemistries) > 1
        found.append(
            Block(
                f"{mode}, {label_of(metric)}",
                (*chemistries, "all") if several else tuple(chemistries),
                {
                    method: (
                        *(_entry(mine, name, metric) for name in chemistries),
                        *[statistic([row[metric] for row in mine])] * several,
                    )
                    for method, mine in grouped(own, "method").items()
                },
                {
                    method: (*(entries.get(name) for name in chemistries), *[None] * several)
                    for method, entries in theirs.get(mode, {}).items()
                },
            )
        )
    return found


def _entry(rows: Sequence[Row], chemistry: str, metric: str) -> Statistic | None:
    values = [row[metric] for row in rows if row["chemistry"] == chemistry]
    return statistic(values) if values else None


def markdown(campaign: Campaign) -> str:
    """All tables as Markdown, and the comparisons behind them."""
    parts = [_coverage(campaign.rows)]
    parts += [f"**{block.title}**\n\n{markdown_table(*_content(block, in_markdown))}" for block in campaign.blocks]
    if campaign.comparisons:
        title = (
            f"**against {campaign.reference}** ({label_of(campaign.metric)}; ratio of errors, geometric mean over "
            "cases, bootstrap 95 % interval; Wilcoxon signed-rank, Holm-corrected)"
        )
        parts.append(f"{title}\n\n{table_of(campaign.comparisons, _COMPARED)}")
    spent = [[method, *map(number, values)] for method, values in effort(campaign.rows).items()]
    parts.append(f"**effort, mean a cell**\n\n{markdown_table(['method', *EFFORT.values()], spent)}")
    return "\n\n".join(parts) + "\n"


def latex(campaign: Campaign) -> str:
    """All tables as LaTeX (booktabs)."""
    parts = ["% \\usepackage{booktabs}"]
    parts += [latex_table(block.title, *_content(block, in_latex)) for block in campaign.blocks]
    if campaign.comparisons:
        title = f"against {campaign.reference}, {label_of(campaign.metric)}"
        lines = entries_of(campaign.comparisons, _COMPARED)
        parts.append(latex_table(title, list(_COMPARED), [[line[0], *map(in_latex, line[1:])] for line in lines]))
    return "\n\n".join(parts) + "\n"


def _coverage(rows: Sequence[Row]) -> str:
    done = sum(row["state"] == "done" for row in rows)
    tasks, seeds = len({row["task"] for row in rows}), len({row["seed"] for row in rows})
    missing = f", {len(rows) - done} without a result" if done < len(rows) else ""
    return (
        f"{counted(len(rows), 'cell')}: {counted(tasks, 'task')}, {counted(seeds, 'seed')}{missing}. "
        "Mean ± standard deviation over cells; best bold, second underlined."
    )


def _content(block: Block, show: Callable[[str, Emphasis], str]) -> tuple[list[str], list[list[str]]]:
    """Heads and lines of a table of errors."""
    lines = [[method, *(_shown(value, rank, show) for value, rank in row), _count(row)] for method, row in block.ranked]
    lines += [[name, *(_shown(value, None, show) for value in row), ""] for name, row in block.quoted.items()]
    return ["method", *block.columns, "cells"], lines


def _shown(value: Statistic | None, rank: Emphasis, show: Callable[[str, Emphasis], str]) -> str:
    if value is None:
        return show("–", None)
    known, sign, missing = str(value).partition(" (")
    return show(known, rank) + sign + missing


def _count(row: Sequence[tuple[Statistic | None, Emphasis]]) -> str:
    known = [value.count for value, _ in row if value is not None]
    return str(known[-1] if known else 0)


_COMPARED = {
    "method": "{method}",
    "ratio": "{ratio:.3g}",
    "95 % interval": "{low:.3g} to {high:.3g}",
    "cases worse / better / all": "{worse} / {better} / {cases}",
    "p": "{adjusted_p:.2g}",
    "verdict": "{verdict}",
}
"""The table of comparisons: entries by their heads."""


def effort(rows: Sequence[Row]) -> dict[str, list[float]]:
    """Means of `EFFORT` by method, finished cells only; of cells that know it, as a price, and NaN where none does."""
    done = [row for row in rows if row["state"] == "done"]
    return {method: [mean_of(mine, name) for name in EFFORT] for method, mine in grouped(done, "method").items()}
