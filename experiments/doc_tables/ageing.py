"""Tables of ageing: the published tasks of 200 cycles, what a life costs, and measured lives foretold."""

from __future__ import annotations

import numpy as np

from ..campaign.summary import geometric_mean, statistic
from ..campaign.text_tables import markdown_table
from .layout import short
from .results import Results

_PAPER = {"mape": 1.37, "q_mape": 0.51}
"""The paper's better agent on its five ageing tasks (its table of long-horizon degradation), in percent."""


def published_lives(results: Results) -> str:
    """The paper's ageing tasks, run by run, and their means by method."""
    rows = sorted(results.rows("ageing"), key=lambda row: (row["method"], row["task"]))
    lines = [
        [
            row["task"],
            row["method"],
            f"{short(row['initial_mape'])} %",
            f"{short(row['mape'])} %",
            f"{short(row['q_mape'])} %",
            f"{short(row['fade_error'])} %",
            f"{row['simulations']:.0f}",
        ]
        for row in rows
    ]
    heads = ["task", "method", "total MAPE before", "after", "charge MAPE", "capacity over all cycles", "simulations"]
    remarks = []
    for method in sorted({row["method"] for row in rows}):
        own = [row for row in rows if row["method"] == method]
        found = {name: statistic([row[name] for row in own]).mean for name in _PAPER}
        remarks.append(
            f"* {method}: mean total MAPE {short(found['mape'])} %, charge {short(found['q_mape'])} % over {len(own)} "
            f"runs, {max(row['simulations'] for row in own):.0f} simulations at most (the paper's better agent: "
            f"{_PAPER['mape']} % and {_PAPER['q_mape']} % over five tasks)."
        )
    return results.framed("ageing", markdown_table(heads, lines), "\n".join(remarks))


def methods(results: Results, name: str) -> str:
    """Total MAPE of every task by every method of a grid, and each method's geometric mean."""
    rows = results.rows(name)
    tasks, compared = (list(dict.fromkeys(row[column] for row in rows)) for column in ("task", "method"))
    found = {(row["task"], row["method"]): row["mape"] for row in rows}
    begun = {row["task"]: row["initial_mape"] for row in rows}
    lines = [
        [task, f"{short(begun[task])} %", *(f"{short(found[task, method])} %" for method in compared)] for task in tasks
    ]
    means = [geometric_mean(found[task, method] for task in tasks) for method in compared]
    lines.append(["geometric mean", "", *(f"{short(mean)} %" for mean in means)])
    gained = [
        f"{method} {sum(found[task, method] < begun[task] for task in tasks)} of {len(tasks)}" for method in compared
    ]
    return results.framed(
        name,
        markdown_table(["task", "start", *compared], lines),
        f"* Better than the start: {', '.join(gained)}.",
    )


def life_cost(results: Results) -> str:
    """What an evaluation of a life costs."""
    rows = results.rows("life_cost")
    plain = rows[-1]
    lines = [
        [
            row["way"],
            f"{row['simulated']:.0f} of {row['cycles']:.0f}",
            f"{short(row['evaluation_s'])} s",
            f"{plain['evaluation_s'] / row['evaluation_s']:.1f}",
            f"{row['peak_mb']:.0f} MB",
            f"{short(row['fade_error_pct'])} %",
        ]
        for row in rows
    ]
    heads = ["way", "cycles solved", "processor time", "times as cheap", "peak memory", "largest capacity difference"]
    return results.framed("life_cost", markdown_table(heads, lines))


def whole_lives(results: Results) -> str:
    """Measured lives foretold from their first cycles."""
    rows = results.rows("whole_life")
    cells = sorted({row["cell"] for row in rows})
    fitted = rows[0]["fitted_to"]
    lines = []
    for row in rows:
        if row["cycle"] <= fitted and row["cycle"] % 100:
            continue
        inside = row["low_ah"] <= row["measured_ah"] <= row["high_ah"]
        lines.append(
            [
                row["cell"],
                f"{row['cycle']:.0f}" + (" (fitted)" if row["cycle"] <= fitted else ""),
                f"{row['measured_ah']:.3f}",
                f"{row['predicted_ah']:.3f}",
                f"{100.0 * (row['predicted_ah'] / row['measured_ah'] - 1.0):+.1f} %",
                f"{row['low_ah']:.3f} to {row['high_ah']:.3f}" + ("" if inside else ", does not hold it"),
            ]
        )
    heads = ["cell", "cycle", "measured / A h", "predicted / A h", "off by", "95 % band / A h"]
    remarks = []
    for cell in cells:
        later = [row for row in rows if row["cell"] == cell and row["cycle"] > fitted]
        off = [100.0 * abs(row["predicted_ah"] / row["measured_ah"] - 1.0) for row in later]
        held = sum(row["low_ah"] <= row["measured_ah"] <= row["high_ah"] for row in later)
        remarks.append(
            f"* {cell}: {short(off[-1])} % off at cycle {later[-1]['cycle']:.0f} (aim: 2 %), "
            f"{short(float(np.max(off)))} % at most; the band holds {held} of {len(later)} cycles after the fit."
        )
    return results.framed("whole_life", markdown_table(heads, lines), "\n".join(remarks))


def trends(results: Results) -> str:
    """What simple laws of the cycle number, fitted to the first cycles of measured lives, come to later."""
    rows = results.rows("fade_trends")
    lines = [
        [row["cell"], row["law"], f"{row['fitted_to']:.0f}", f"{row['rms_pct']:.2f} %", f"{row['off_pct']:+.1f} %"]
        for row in rows
    ]
    heads = ["cell", "law", "fitted to cycle", "left of the fitted cycles", f"off at cycle {rows[0]['cycle']:.0f}"]
    return results.framed("fade_trends", markdown_table(heads, lines))


def mechanisms(results: Results) -> str:
    """Which mechanism was found in lives with a hidden one, and in measured ones."""
    rows = results.rows("life_discovery")
    lines = [
        [
            row["task"],
            _text(row["hidden"], "not known"),
            row["verdict"],
            _text(row["named"], "none") + _text(row["rivals"], "", " or {}"),
            row["best"],
            f"{row['base_error']:.1f} → {row['error']:.1f}",
            f"{row['base_later_error']:.1f} → {row['later_error']:.1f}",
            f"{row['processor_s']:.0f}",
        ]
        for row in rows
    ]
    heads = ["life", "hidden", "verdict", "named", "nearest", "fitted cycles", "later cycles", "processor s"]
    known = [row for row in rows if isinstance(row["hidden"], str)]
    right = sum(row["verdict"] == "effect-found" and row["named"] == row["hidden"] for row in known)
    wrong = sum(row["verdict"] == "effect-found" and row["named"] != row["hidden"] for row in known)
    remark = (
        f"* {right} of {len(known)} hidden mechanisms named alone, {wrong} wrong names. Errors: standard deviations."
    )
    return results.framed("life_discovery", markdown_table(heads, lines), remark)


def _text(field: object, empty: str, form: str = "{}") -> str:
    """A field in some words; others where it is empty."""
    return form.format(field) if isinstance(field, str) else empty


def modes(results: Results) -> str:
    """How lithium, active material and resistance drift over the same lives."""
    rows = results.rows("life_modes")
    lines = [
        [
            row["task"],
            row["quantity"],
            f"{short(row['value'])} ± {short(row['half'])}",
            f"{row['cycle']:.0f}",
            f"{short(row['per_100_cycles'])} ± {short(row['half_per_100_cycles'])}",
        ]
        for row in rows
    ]
    heads = ["life", "quantity", "at the end (95 %)", "cycle", "in 100 cycles (95 %)"]
    return results.framed("life_modes", markdown_table(heads, lines))
