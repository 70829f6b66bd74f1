"""Tables of ageing: the published tasks of 200 cycles, and methods beside each other."""

from collections.abc import Callable, Sequence
from typing import Any

from bsa.experiments.campaign.summary import geometric_mean, grouped, mean_of
from bsa.experiments.campaign.text_tables import Entry, brief, markdown_table, span, table_of

from .results import Results

_PAPER = {"mape": 1.37, "q_mape": 0.51}
"""The paper's better agent on its five ageing tasks (its table of long-horizon degradation), in percent."""


def published_lives(results: Results) -> str:
    """The paper's ageing tasks, each with the largest errors from its starts, and their mean."""
    rows = sorted(results.rows("ageing"), key=lambda row: str(row["task"]))
    tasks = grouped([{**row, "task": row["task"].partition("-start-")[0]} for row in rows], "task")
    columns: dict[str, Entry] = {
        "task": lambda task: task,
        "total MAPE before": lambda task: f"{_range(tasks[task], 'initial_mape')} %",
        "after, largest": lambda task: f"{_largest(tasks[task], 'mape')} %",
        "capacity over all cycles, largest": lambda task: f"{_largest(tasks[task], 'fade_error')} %",
        "simulations": lambda task: _range(tasks[task], "simulations", "{:.0f}".format),
    }
    remark = (
        f"* Mean total MAPE {brief(mean_of(rows, 'mape'))} %, charge {brief(mean_of(rows, 'q_mape'))} % over "
        f"{len(rows)} runs of `hybrid` (the paper's better agent: {_PAPER['mape']} % and {_PAPER['q_mape']} % over "
        "five tasks)."
    )
    return results.framed("ageing", table_of(tasks, columns), remark)


def _largest(rows: Sequence[dict[str, Any]], name: str) -> str:
    return brief(max(row[name] for row in rows))


def _range(rows: Sequence[dict[str, Any]], name: str, form: Callable[[float], str] = brief) -> str:
    return span([row[name] for row in rows], form)


def methods(results: Results, name: str) -> str:
    """Errors of every method of a grid over its tasks."""
    rows = results.rows(name)
    lines = []
    for method, own in grouped(rows, "method").items():
        worst = max(own, key=lambda row: float(row["mape"]))
        mean = geometric_mean(row["mape"] for row in own)
        lines.append([method, f"{brief(mean)} %", f"{brief(worst['mape'])} % ({worst['task']})"])
    tasks = len({row["task"] for row in rows})
    better = sum(row["mape"] < row["initial_mape"] for row in rows)
    remark = (
        f"* {tasks} tasks, whose starts have {_range(rows, 'initial_mape')} %. {better} of {len(rows)} runs have a "
        "smaller error than their start."
    )
    return results.framed(name, markdown_table(["total MAPE", "geometric mean", "largest"], lines), remark)
