"""Tables of ageing: the published tasks of 200 cycles, and methods beside each other."""

from bsa.experiments.campaign.summary import geometric_mean, grouped, mean_of
from bsa.experiments.campaign.text_tables import brief, markdown_table, table_of

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
