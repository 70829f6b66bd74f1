"""Tables of ageing: the published tasks of 200 cycles, what a life costs, and measured lives foretold."""

from bsa.experiments.campaign.summary import Row, geometric_mean, grouped, mean_of
from bsa.experiments.campaign.text_tables import Entry, brief, markdown_table, table_of

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
    rows = results.rows("life_cost")
    plain_s = rows[-1]["evaluation_s"]
    columns: dict[str, Entry] = {
        "way": "{way}",
        "cycles solved": "{simulated:.0f} of {cycles:.0f}",
        "processor time": "{evaluation_s:brief} s",
        "times as cheap": lambda row: f"{plain_s / row['evaluation_s']:.1f}",
        "peak memory": "{peak_mb:.0f} MB",
        "largest capacity difference": "{fade_error_pct:brief} %",
    }
    return results.framed("life_cost", table_of(rows, columns))


def whole_lives(results: Results) -> str:
    """Measured lives foretold from their first cycles."""
    rows = results.rows("whole_life")
    fitted = rows[0]["fitted_to"]
    columns: dict[str, Entry] = {
        "cell": "{cell}",
        "cycle": lambda row: f"{row['cycle']:.0f}" + (" (fitted)" if row["cycle"] <= fitted else ""),
        "measured / A h": "{measured_ah:.3f}",
        "predicted / A h": "{predicted_ah:.3f}",
        "off by": lambda row: f"{_off_pct(row):+.1f} %",
        "95 % band / A h": lambda row: (
            f"{row['low_ah']:.3f} to {row['high_ah']:.3f}" + ("" if _inside(row) else ", does not hold it")
        ),
    }
    told = [row for row in rows if row["cycle"] > fitted or not row["cycle"] % 100]
    remarks = []
    for cell, own in sorted(grouped(rows, "cell").items()):
        later = [row for row in own if row["cycle"] > fitted]
        off = [abs(_off_pct(row)) for row in later]
        remarks.append(
            f"* {cell}: {brief(off[-1])} % off at cycle {later[-1]['cycle']:.0f} (aim: 2 %), {brief(max(off))} % at "
            f"most; the band holds {sum(map(_inside, later))} of {len(later)} cycles after the fit."
        )
    return results.framed("whole_life", table_of(told, columns), "\n".join(remarks))


def _off_pct(row: Row) -> float:
    return float(100.0 * (row["predicted_ah"] / row["measured_ah"] - 1.0))


def _inside(row: Row) -> bool:
    return bool(row["low_ah"] <= row["measured_ah"] <= row["high_ah"])


def trends(results: Results) -> str:
    """What simple laws of the cycle number, fitted to the first cycles of measured lives, come to later."""
    rows = results.rows("fade_trends")
    columns = {
        "cell": "{cell}",
        "law": "{law}",
        "fitted to cycle": "{fitted_to:.0f}",
        "left of the fitted cycles": "{rms_pct:.2f} %",
        f"off at cycle {rows[0]['cycle']:.0f}": "{off_pct:+.1f} %",
    }
    return results.framed("fade_trends", table_of(rows, columns))


def mechanisms(results: Results) -> str:
    """Which mechanism was found in lives with a hidden one, and in measured ones."""
    rows = results.rows("life_discovery")
    columns: dict[str, Entry] = {
        "life": "{task}",
        "hidden": lambda row: _text(row["hidden"], "not known"),
        "verdict": "{verdict}",
        "named": lambda row: _text(row["named"], "none") + _text(row["rivals"], "", " or {}"),
        "nearest": "{best}",
        "fitted cycles": "{base_error:.1f} → {error:.1f}",
        "later cycles": "{base_later_error:.1f} → {later_error:.1f}",
        "processor s": "{processor_s:.0f}",
    }
    known = [row for row in rows if isinstance(row["hidden"], str)]
    right = sum(row["verdict"] == "effect-found" and row["named"] == row["hidden"] for row in known)
    wrong = sum(row["verdict"] == "effect-found" and row["named"] != row["hidden"] for row in known)
    remark = (
        f"* {right} of {len(known)} hidden mechanisms named alone, {wrong} wrong names. Errors: standard deviations."
    )
    return results.framed("life_discovery", table_of(rows, columns), remark)


def _text(field: object, empty: str, form: str = "{}") -> str:
    """A field in some words; others where it is empty."""
    return form.format(field) if isinstance(field, str) else empty


def modes(results: Results) -> str:
    """How lithium, active material and resistance drift over the same lives."""
    columns = {
        "life": "{task}",
        "quantity": "{quantity}",
        "at the end (95 %)": "{value:brief} ± {half:brief}",
        "cycle": "{cycle:.0f}",
        "in 100 cycles (95 %)": "{per_100_cycles:brief} ± {half_per_100_cycles:brief}",
    }
    return results.framed("life_modes", table_of(results.rows("life_modes"), columns))
