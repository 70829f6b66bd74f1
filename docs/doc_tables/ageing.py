"""Tables of ageing: the published tasks of 200 cycles, what a life costs, and measured lives foretold."""

from bsa.experiments.campaign.summary import geometric_mean, grouped, mean_of
from bsa.experiments.campaign.text_tables import brief, markdown_table, table_of
from bsa.experiments.studies.fade_trends import trends_table
from bsa.experiments.studies.life_cost import cost_table
from bsa.experiments.studies.life_discovery import mechanisms_table, modes_table
from bsa.experiments.studies.whole_life import forecast_table

from .results import Results

_PAPER = {"mape": 1.37, "q_mape": 0.51}
"""The paper's better agent on its five ageing tasks (its table of long-horizon degradation), in percent."""


def published_lives(results: Results) -> str:
    """The paper's ageing tasks, run by run, and their means by method."""
    rows = sorted(results.rows("ageing"), key=lambda row: (row["method"], row["task"]))
    columns = {
        "task": "{task}",
        "method": "{method}",
        "total MAPE before": "{initial_mape:brief} %",
        "after": "{mape:brief} %",
        "charge MAPE": "{q_mape:brief} %",
        "capacity over all cycles": "{fade_error:brief} %",
        "simulations": "{simulations:.0f}",
    }
    remarks = [
        f"* {method}: mean total MAPE {brief(mean_of(own, 'mape'))} %, charge {brief(mean_of(own, 'q_mape'))} % over "
        f"{len(own)} runs, {max(row['simulations'] for row in own):.0f} simulations at most (the paper's better "
        f"agent: {_PAPER['mape']} % and {_PAPER['q_mape']} % over five tasks)."
        for method, own in grouped(rows, "method").items()
    ]
    return results.framed("ageing", table_of(rows, columns), "\n".join(remarks))


def methods(results: Results, name: str) -> str:
    """Total MAPE of every task by every method of a grid, and each method's geometric mean."""
    rows = results.rows(name)
    tasks, compared = (list(dict.fromkeys(row[column] for row in rows)) for column in ("task", "method"))
    found = {(row["task"], row["method"]): row["mape"] for row in rows}
    begun = {row["task"]: row["initial_mape"] for row in rows}
    lines = [
        [task, f"{brief(begun[task])} %", *(f"{brief(found[task, method])} %" for method in compared)] for task in tasks
    ]
    means = [geometric_mean(found[task, method] for task in tasks) for method in compared]
    lines.append(["geometric mean", "", *(f"{brief(mean)} %" for mean in means)])
    gained = [
        f"{method} {sum(found[task, method] < begun[task] for task in tasks)} of {len(tasks)}" for method in compared
    ]
    return results.framed(
        name, markdown_table(["task", "start", *compared], lines), f"* Better than the start: {', '.join(gained)}."
    )


def life_cost(results: Results) -> str:
    """What an evaluation of a life costs."""
    return results.framed("life_cost", cost_table(results.rows("life_cost")))


def whole_lives(results: Results) -> str:
    """Measured lives foretold from their first cycles."""
    return results.framed("whole_life", forecast_table(results.rows("whole_life")))


def trends(results: Results) -> str:
    """What simple laws of the cycle number, fitted to the first cycles of measured lives, come to later."""
    return results.framed("fade_trends", trends_table(results.rows("fade_trends")))


def mechanisms(results: Results) -> str:
    """Which mechanism was found in lives with a hidden one, and in measured ones."""
    return results.framed("life_discovery", mechanisms_table(results.rows("life_discovery")))


def modes(results: Results) -> str:
    """How lithium, active material and resistance drift over the same lives."""
    return results.framed("life_modes", modes_table(results.rows("life_modes")))
