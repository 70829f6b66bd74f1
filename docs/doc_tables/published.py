"""Tables of the published tasks: the main table, what the start says, ORegan2022, and the baselines beside."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from bsa.experiments.campaign.columns import EARLY
from bsa.experiments.campaign.summary import grouped, main_table, paper_rows, statistic
from bsa.experiments.campaign.text_tables import Entry, bold, brief, markdown_table, span, spread, table_of

from .results import Results

Row = dict[str, Any]

SLOW = "ORegan2022"
_DEFAULT = "paper Default"
_REPRODUCED = 0.003
"""Relative difference below which the start counts as the paper's: that of its printed digits and the integrator."""

_AIM = 0.1
"""Error in percent that half of the tasks are to be below after a few simulations."""

_WITH_ONE_OBJECTIVE = ("hybrid", "least-squares", "bo", "cma-es", "de")


def main(results: Results) -> str:
    """Both modes, with the paper's rows."""
    rows = results.rows("published")
    ours, early, theirs = main_table(rows), main_table(rows, "early_objective"), paper_rows()
    parts = []
    for mode, row in ((mode, methods["hybrid"]) for mode, methods in ours.items()):
        sets = list(row)
        best = {name: _best(theirs[mode], name) for name in sets}
        lines = [["hybrid", *(bold(spread(row[name]), row[name].mean < best[name]) for name in sets)]]
        lines += [[f"hybrid, {EARLY} simulations", *(spread(early[mode]["hybrid"][name]) for name in sets)]]
        lines += [
            [f"*{name}*", *(f"*{spread(entry)}*" for entry in entries.values())]
            for name, entries in theirs[mode].items()
        ]
        parts += [f"{mode.capitalize()}:", markdown_table(["method", *sets], lines)]
    return results.framed("published", *parts)


def _best(methods: dict[str, Any], name: str) -> float:
    return min(float(row[name].mean) for row in methods.values())


def led_and_alone(results: Results) -> str:
    """The hybrid with and without the low-fidelity model, on the same tasks."""
    rows = results.rows("low_fidelity")
    by_method = {method: {row["task"]: row for row in own} for method, own in grouped(rows, "method").items()}
    columns: dict[str, Entry] = {
        "scaffold": lambda method: method,
        "tasks": lambda method: str(len(by_method[method])),
        f"after {EARLY} / %": lambda method: _range(by_method[method], "early_objective"),
        "at the end / %": lambda method: _range(by_method[method], "mape"),
        "simulations": lambda method: _range(by_method[method], "simulations", "{:.0f}".format),
        "time of all / s": lambda method: _range(by_method[method], "simulator_s", "{:.0f}".format),
    }
    alone, led_by_it = by_method["no-low-fidelity"], by_method["hybrid"]
    ratios = [led_by_it[task]["simulator_s"] / alone[task]["simulator_s"] for task in alone]
    behind = [
        f"{task} ({brief(led_by_it[task]['mape'])} and {brief(alone[task]['mape'])} %)"
        for task in alone
        if led_by_it[task]["mape"] > alone[task]["mape"]
    ]
    words = (
        f"* Time with it by that without it: {span(ratios)}.\n* Larger error with it: {', '.join(behind) or 'none'}."
    )
    return results.framed("low_fidelity", table_of(by_method, columns), words)


def _range(rows: Mapping[str, Row], name: str, form: Callable[[float], str] = brief) -> str:
    return span([row[name] for row in rows.values()], form)


def led(results: Results) -> str:
    """Some tasks by a version whose fits a low-fidelity model leads, beside their rows of the main table."""
    rows, earlier = results.rows("published_led"), {row["task"]: row for row in results.rows("published")}
    lines, above = [], []
    for mode, name in dict.fromkeys((row["mode"], row["chemistry"]) for row in rows):
        now = [row for row in rows if (row["mode"], row["chemistry"]) == (mode, name)]
        both = (now, [earlier[row["task"]] for row in now])
        early = [spread([row["early_objective"] for row in some]) for some in both]
        made = " (".join(f"{np.mean([row['simulations'] for row in some]):.0f}" for some in both)
        best = _best(paper_rows()[mode], name)
        lines.append([f"{name}, {mode}", spread(_errors(now)), *early, f"{made})", f"*{brief(best)}*"])
        if np.mean([row["early_objective"] for row in now]) >= best:
            above.append(f"{mode} {name}")
    heads = ["error in %", "at the end", f"after {EARLY}", "main table", "simulations (main table)"]
    heads += ["*paper's best row, 100*"]
    before = [earlier[row["task"]] for row in rows]
    soon, soon_before = ([float(row["early_objective"]) for row in some] for some in (rows, before))
    worst = max(rows, key=lambda row: row["mape"])
    remarks = [
        f"* After {EARLY} simulations: median {_median(soon)} % ({_median(soon_before)} in the main table; aim: "
        f"{_AIM}), mean {_mean(soon)} % ({_mean(soon_before)}); {sum(error < _AIM for error in soon)} of {len(rows)} "
        f"below {_AIM} %. Not below the paper's best row, of 100 simulations: {', '.join(above) or 'none'} (aim: "
        f"none).",
        f"* At the end: median {_median(_errors(rows))} % ({_median(_errors(before))}), worst {brief(worst['mape'])} % "
        f"({worst['task']}).",
    ]
    return results.framed("published_led", markdown_table(heads, lines), "\n".join(remarks))


def begun_elsewhere(results: Results) -> str:
    """Tasks that were far off after 20 simulations, again by a later version of the low-fidelity model."""
    rows, earlier = results.rows("begun_elsewhere"), {row["task"]: row for row in results.rows("published_led")}

    def beside(row: Row, name: str, form: Callable[[float], str] = brief) -> str:
        return f"{form(earlier[row['task']][name])} → {form(row[name])}"

    columns: dict[str, Entry] = {
        "task": lambda row: f"{row['task']} ({row['chemistry']} {row['rates']})",
        f"after {EARLY} / %": lambda row: beside(row, "early_objective"),
        "at the end / %": lambda row: beside(row, "mape"),
        "simulations": lambda row: beside(row, "simulations", "{:.0f}".format),
        "low-fidelity simulations": lambda row: beside(row, "low_fidelity_simulations", "{:.0f}".format),
    }
    return results.framed("begun_elsewhere", table_of(rows, columns))


def _median(errors: Sequence[float]) -> str:
    return brief(float(np.median(errors)))


def _mean(errors: Sequence[float]) -> str:
    return brief(float(np.mean(errors)))


def summary(results: Results) -> str:
    """What the main table comes to."""
    rows = results.rows("published")
    quick = [row for row in rows if row["chemistry"] != SLOW]
    found, early = statistic(_errors(quick)), [row["early_objective"] for row in quick]
    simulations, failed = (sum(row[name] for row in quick) for name in ("simulations", "failed_simulations"))
    below, cells = below_the_paper(rows)
    lines = [
        f"* {below} of the {cells} cells are below the best row of the paper's table, Bayesian optimisation included.",
        f"* All {len(rows)} tasks: median {_median(_errors(rows))} %; {_under(rows, 0.1)} end below 0.1 %.",
        f"* The {len(quick)} tasks of the four other base cells: mean {brief(found.mean)} %, median "
        f"{_median(_errors(quick))} %, worst {brief(found.worst)} %; {_under(quick, 0.01)} end below 0.01 %, "
        f"{_under(quick, 0.1)} below 0.1 % (aim: a mean below 0.1 %), with {simulations / len(quick):.0f} "
        f"simulations in the mean.",
        f"* Above 1 % (aim: none): {', '.join(above_one_percent(quick))}. {failed:.0f} of their {simulations:,.0f} "
        f"simulations failed.",
        f"* After {EARLY} simulations of the same runs, on the search mesh (the first Jacobian takes 9 of them): mean "
        f"{_mean(early)} %, median {_median(early)} %.",
    ]
    return "\n".join(lines)


def below_the_paper(rows: Sequence[Row]) -> tuple[int, int]:
    """Cells of the main table that are below the paper's best row, and all cells."""
    theirs = paper_rows()
    cells = [
        entry.mean < _best(theirs[mode], name)
        for mode, methods in main_table(rows).items()
        for name, entry in methods["hybrid"].items()
    ]
    return sum(cells), len(cells)


def above_one_percent(rows: Sequence[Row]) -> list[str]:
    """The tasks with an error above 1 %, the largest first."""
    far = sorted((row for row in rows if row["mape"] > 1), key=lambda row: -row["mape"])
    return [f"{row['task']} ({row['chemistry']} {row['rates']}, {brief(row['mape'])} %)" for row in far]


def _errors(rows: Sequence[Row]) -> list[float]:
    return [row["mape"] for row in rows]


def _under(rows: Sequence[Row], limit: float) -> int:
    return sum(row["mape"] < limit for row in rows)


def start(results: Results) -> str:
    """Whether the untouched start is the paper's Default row."""
    theirs, differences, lines = paper_rows(), [], []
    for mode, methods in main_table(results.rows("published"), "initial_mape").items():
        line = [mode]
        for name, entry in methods["hybrid"].items():
            differences.append(entry.mean / theirs[mode][_DEFAULT][name].mean - 1.0)
            line.append(f"{entry.mean:.2f} ({100 * differences[-1]:+.1f} %)")
        lines.append(line)
    same = sum(abs(difference) <= _REPRODUCED for difference in differences)
    words = (
        f"The untouched start reproduces the paper's Default row within {100 * _REPRODUCED:g} % in {same} of "
        f"{len(differences)} cells. Our start, and its difference from the paper's:"
    )
    sets = list(main_table(results.rows("published"))["regular"]["hybrid"])
    return "\n\n".join([words, markdown_table(["", *sets], lines)])


def oregan(results: Results) -> str:
    """The base cell that is slow, by mode."""
    lines = []
    for mode in ("regular", "extreme"):
        rows = [row for row in results.rows("published") if (row["mode"], row["chemistry"]) == (mode, SLOW)]
        errors, early = statistic(_errors(rows)), spread([row["early_objective"] for row in rows])
        entries = [bold(spread(errors)), _median(_errors(rows)), brief(errors.worst)]
        more = [str(sum(row["mape"] > 10 for row in rows)), early, f"*{brief(_best(paper_rows()[mode], SLOW))}*"]
        lines.append([mode, str(len(rows)), *entries, *more])
    longer = [f"{row['task']} {row['simulations']:.0f}" for row in longer_tasks(results.rows("published"))]
    heads = [
        "",
        "tasks",
        "mean",
        "median",
        "worst",
        "above 10 %",
        f"after {EARLY} simulations",
        "*the paper's best row*",
    ]
    note = f"Tasks with more than 50 simulations: {', '.join(longer)}." if longer else "All had 50 simulations."
    return "\n\n".join([markdown_table(heads, lines), note])


def longer_tasks(rows: Sequence[Row]) -> list[Row]:
    """Tasks of the slow cell that had more than its 50 simulations."""
    return [row for row in rows if row["chemistry"] == SLOW and row["simulations"] > 50]


def baselines(results: Results) -> str:
    """Every method on the tasks that all of them have run, and qNEHVI on its tasks."""
    others = results.rows("baselines")
    cases = {row["task"] for row in others if row["method"] == "least-squares"}
    rows = [*(row for row in results.rows("published") if row["task"] in cases), *others]
    lines = [[method, *_overall(rows, method)] for method in _WITH_ONE_OBJECTIVE]
    heads = ["error / %", "mean", "median", "worst", f"mean after {EARLY}"]
    return results.framed("baselines", markdown_table(heads, lines), "\n".join(_remarks(rows, cases)))


def _of(rows: Sequence[Row], method: str, cases: set[str] | None = None) -> dict[str, Row]:
    return {row["task"]: row for row in rows if row["method"] == method and (cases is None or row["task"] in cases)}


def _overall(rows: Sequence[Row], method: str) -> list[str]:
    own = list(_of(rows, method).values())
    errors, early = _errors(own), statistic([row["early_objective"] for row in own]).mean
    return [spread(errors), _median(errors), brief(max(errors)), brief(early)]


def _remarks(rows: Sequence[Row], cases: set[str]) -> list[str]:
    hybrid = _of(rows, "hybrid")
    ratios = [
        row["mape"] / hybrid[case]["mape"]
        for method in ("bo", "cma-es", "de")
        for case, row in _of(rows, method).items()
    ]
    seven = set(_of(rows, "qnehvi"))
    shared = ", ".join(
        f"{method} {spread(_errors(list(_of(rows, method, seven).values())))}"
        for method in ("qnehvi", *_WITH_ONE_OBJECTIVE)
    )
    lines = [
        f"* The least ratio of the error of a method without slopes to the hybrid's, over {len(cases)} tasks: "
        f"{brief(min(ratios))}.",
        f"* The {len(seven)} tasks on which qNEHVI (errors of charge, current and voltage as three objectives) has "
        f"run: {shared}.",
    ]
    times = []
    for method in ("bo", "qnehvi"):
        own = list(_of(rows, method).values())
        spent, wall = ([row[name] for row in own] for name in ("proposer_s", "wall_s"))
        times.append(f"{min(spent):.0f} to {max(spent):.0f} of {min(wall):.0f} to {max(wall):.0f} s ({method})")
    longest = max(float(row["proposer_s"]) for row in hybrid.values())
    return [*lines, f"* Proposals take {' and '.join(times)} a task, those of the hybrid {longest:.1f} s at most."]
