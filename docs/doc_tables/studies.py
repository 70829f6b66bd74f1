"""Tables of the other calibration studies: noise, random cells, advice, ablation, time, recovery, warm-up."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bsa.experiments.campaign.statistics import compare
from bsa.experiments.campaign.summary import exact_interval, geometric_mean, grouped, statistic
from bsa.experiments.campaign.text_tables import Entry, bold, brief, markdown_table, span, spread, table_of
from bsa.experiments.studies.coverage import FIT_POINTS, coverage_table, excesses
from bsa.experiments.studies.no_harm import summary, verdict_of
from bsa.experiments.studies.recovery import recovery_table

from .published import above_one_percent
from .results import Results

_MANY, _CORES = 100_000, 400
"""Cells and cores for which the cost of one cell is reckoned up."""


def random_cells(results: Results) -> str:
    """Cases that nobody tuned for."""
    rows = results.rows("random")
    errors = [row["mape"] for row in rows]
    mean, median = brief(float(np.mean(errors))), brief(float(np.median(errors)))
    words = (
        f"* {len(rows)} cases of {len(grouped(rows, 'chemistry'))} base cells: mean {mean} %, median {median} %, worst "
        f"{brief(max(errors))} %; the starts have {span([row['initial_mape'] for row in rows])} %.\n"
        f"* Above 1 %: {', '.join(above_one_percent(rows)) or 'none'}."
    )
    return results.framed("random", words)


def noise(results: Results) -> str:
    """The same tasks with measurement noise and without."""
    noisy = {row["task"]: row["mape"] for row in results.rows("noise")}
    clean = {row["task"]: row["mape"] for row in results.rows("published") if row["task"] in noisy}
    lines = [["with noise, 60 simulations", *(brief(value) for value in noisy.values())]]
    lines += [["without, 100 simulations", *(brief(clean[case]) for case in noisy)]]
    return results.framed("noise", markdown_table(["", *noisy], lines))


def no_harm(results: Results) -> str:
    """Advisers of the hybrid against least squares alone."""
    found = [verdict_of(row) for row in results.rows("no_harm")]
    columns: dict[str, Entry] = {
        "adviser": "{adviser}",
        "cases": "{cases}",
        "no worse": "{no_worse}",
        "better": "{better}",
        "largest harm / points": "{largest_harm_points:brief}",
        "share of cases harmed": lambda row: exact_interval(row["cases"] - row["no_worse"], row["cases"]),
        "hybrid": lambda row: spread(row["advised"]),
        "least squares": lambda row: spread(row["alone"]),
    }
    worse = [f"{v.task} with {v.adviser} ({brief(v.advised)} and {brief(v.alone)} %)" for v in found if not v.no_worse]
    words = (
        f"Worse than least squares: {', '.join(worse)}."
        if worse
        else "In no case was the hybrid worse than least squares."
    )
    return results.framed("no_harm", table_of(summary(found), columns), words)


def ablation(results: Results) -> str:
    """What each part of the scaffold is worth to the rules backend."""
    rows = results.rows("ablation")
    columns: dict[str, Entry] = {
        "against `full`, on `rules`": "{method}",
        "ratio of errors": lambda item: bold(brief(item.ratio), item.holds),
        "95 % interval": "{low:brief} to {high:brief}",
        "worse / better / all": "{worse} / {better} / {cases}",
        "p": "{adjusted_p:.2g}",
        "verdict": "{verdict}",
    }
    methods = grouped(rows, "method")
    means = ", ".join(f"{method} {spread([row['mape'] for row in own])}" for method, own in methods.items())
    return results.framed("ablation", table_of(compare(rows, "full", "mape"), columns), f"Mean errors in %: {means}.")


def coverage(results: Results) -> str:
    """How often intervals contain the truth, for the geometry of a cell and for measured cells."""
    parts = []
    for (points, scaffold), rows in sorted(grouped(results.rows("coverage"), "truth_points", "scaffold").items()):
        tasks = grouped(rows, "task")
        within = sum(excess <= 0.1 for excess in excesses(rows))
        ended = sum(int(found[0]["ended"]) for found in tasks.values())
        spent = np.median([found[0]["simulations_after"] for found in tasks.values()])
        counts = [int(found[0]["parameters"]) for found in tasks.values()]
        parts += [
            f"{_parameters(counts)}, fitted by `{scaffold}`: {len(tasks)} tasks, truth on {points:.0f} mesh points, "
            f"fits on {FIT_POINTS}. {ended} fits ended within 100 simulations; {within} cost at most 10 % more than "
            f"the truth on the fit's mesh. {spent:.0f} simulations after the fit (median).",
            coverage_table(rows),
        ]
    return results.framed("coverage", *parts)


def _parameters(counts: Sequence[int]) -> str:
    """``"9 parameters"``, or the fewest and the most."""
    least, most = min(counts), max(counts)
    return f"{least} parameters" if least == most else f"{least} to {most} parameters"


def recovery(results: Results) -> str:
    """Errors at rates that were not fitted, and how errors of curves and parameters go together."""
    rows = results.rows("recovery")
    table, remarks = recovery_table(rows, results.rows("held_out"))
    fitted = f"* At the rates that were fitted: mean {brief(statistic([row['mape'] for row in rows]).mean)} %."
    return results.framed("recovery held_out", table, "\n".join([fitted, *remarks]))


def grid_cost(results: Results) -> str:
    """What a cell of a grid costs."""
    rows = results.rows("grid_cost")
    return results.framed("grid_cost", table_of(rows, {"figure": "{figure}", "measured": "{value:brief} {unit}"}))


def grid_scaling(results: Results) -> str:
    """What the same costs come to for many cells."""
    cost = {row["name"]: row["value"] for row in results.rows("grid_cost")}
    hours = cost["run"] * _MANY / 3600
    lines = [
        ["runs", f"{brief(hours)} core hours; {brief(60 * hours / _CORES)} min on {_CORES} cores"],
        ["the grid's own work", f"{brief(cost['overhead'] * _MANY / 6e4)} min"],
        ["files", f"{cost['files'] * _MANY:.1e} files, {brief(cost['bytes'] * _MANY / 1e3)} GB"],
        ["synced journal lines", f"{brief(cost['lines'] * _CORES / cost['run'])} a second on {_CORES} cores"],
        ["a model's tokens", f"{cost['tokens'] * _MANY:.1e}, {cost['prompt']:.0f} % of them prompt"],
    ]
    return markdown_table(["what", f"at {_MANY:,} cells"], lines, 2)


def agent_alone(results: Results) -> str:
    """The agent without least squares on the rules backend."""
    rows = results.rows("agent_alone")
    lines = []
    for cell, own in grouped(rows, "chemistry").items():
        fast = [row for row in own if "2C" in row["rates"].split("/")]
        lines += [_errors_of(cell, own), _errors_of(f"{cell} at 2C", fast)]
    lines.append(_errors_of("all", rows))
    heads = ["error in % after 20 simulations", "tasks", "geometric mean", "largest"]
    return results.framed("agent_alone", markdown_table(heads, lines))


def _errors_of(name: str, rows: Sequence[dict[str, Any]]) -> list[str]:
    errors = [row["mape"] for row in rows]
    return [name, str(len(rows)), brief(geometric_mean(errors)), brief(max(errors))]


def by_hand(results: Results) -> str:
    """Runs whose prompts were answered by hand, beside the hybrid after 20 simulations."""
    early = {row["task"]: row["early_objective"] for row in results.rows("published")}
    columns: dict[str, Entry] = {
        "error in %": "{task}",
        "scaffold": "{scaffold}",
        "start": "{initial_mape:brief}",
        "by hand": "{mape:brief}",
        "simulations": "{simulations:.0f}",
        "hybrid with `rules` after 20": lambda row: brief(early[row["task"]]),
        "calls": "{calls:.0f}",
        "tokens a prompt": lambda row: f"{row['prompt_tokens'] / row['calls']:.0f}",
        "tokens a reply": lambda row: f"{row['reply_tokens'] / row['calls']:.0f}",
    }
    return results.framed("by_hand", table_of(results.rows("by_hand"), columns))
