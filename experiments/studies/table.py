"""The paper's main table: a row for each method, a column for each base cell, best bold, second underlined."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from ...core import files
from ...core.yaml_text import read_yaml
from .cell import CellRecord

REPORTED = ("mape", "q_mape", "i_mape", "v_mape", "rmse", "v_rmse_mv", "capacity_error")
"""Metrics of the best candidate that a row holds."""

PAPER_ROWS_FILE = Path(__file__).with_name("paper_rows.yaml")

EARLY = 20
"""Simulations after which a method is looked at early, as the paper's runtime study does."""


Row = Mapping[str, Any]
"""A cell as `rows_of` writes it and `read_csv` reads it."""

METRICS = {
    "mape": "total MAPE, %",
    "rmse": "total RMSE",
    "early_mape": f"total MAPE, %, after {EARLY} simulations of the same runs, on the search mesh",
}
"""What a table compares: column of the rows, and its title."""


@dataclass(frozen=True)
class Statistic:
    """Mean and standard deviation over the cases of one table entry.

    Attributes
    ----------
    mean, deviation : float
        The deviation has n - 1 in its denominator, as in the paper; NaN for one case.
    worst : float
        Largest value.
    count : int
        Cases with a value.
    missing : int
        Cases in which nothing could be compared; they are not in the mean, and are said in the table.
    """

    mean: float
    deviation: float
    worst: float
    count: int
    missing: int = 0

    def __str__(self) -> str:
        spread = "" if math.isnan(self.deviation) else f"±{_short(self.deviation)}"
        return f"{_short(self.mean)}{spread}" + (f" ({self.missing} without result)" if self.missing else "")


def _short(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value >= 0.1 else f"{value:.2g}"


def statistic(values: Sequence[float]) -> Statistic:
    """Mean, deviation and worst of the values that are numbers."""
    known = np.array([value for value in values if not math.isnan(value)])
    if not known.size:
        return Statistic(math.nan, math.nan, math.nan, 0, len(values))
    deviation = float(known.std(ddof=1)) if known.size > 1 else math.nan
    return Statistic(float(known.mean()), deviation, float(known.max()), known.size, len(values) - known.size)


def exact_interval(count: int, of: int) -> str:
    """The exact 95 % interval of a share (Clopper and Pearson, Biometrika 26 (1934) 404), in percent."""
    found = stats.binomtest(count, of).proportion_ci(0.95, method="exact")
    return f"exact 95 % interval {100 * found.low:.2g} to {100 * found.high:.2g} %"


def main_table(rows: Sequence[Row], metric: str = "mape") -> dict[str, dict[str, dict[str, Statistic]]]:
    """Statistics by mode, method and base cell, in order of appearance."""
    groups: dict[str, dict[str, dict[str, list[float]]]] = {}
    for row in rows:
        own = groups.setdefault(row["mode"], {}).setdefault(row["method"], {})
        own.setdefault(row["parameter_set"], []).append(row[metric])
    return {
        mode: {method: {name: statistic(values) for name, values in row.items()} for method, row in methods.items()}
        for mode, methods in groups.items()
    }


def paper_rows(metric: str = "mape") -> dict[str, dict[str, dict[str, Statistic]]]:
    """The paper's own rows in the same form."""
    content = read_yaml(PAPER_ROWS_FILE)
    return {
        mode: {
            method: {
                name: Statistic(mean, deviation, math.nan, 20)
                for name, (mean, deviation) in zip(content["sets"], entries, strict=True)
            }
            for method, entries in rows.items()
        }
        for mode, rows in content.get(metric, {}).items()
    }


def markdown(rows: Sequence[Row], metric: str = "mape", with_paper: bool = True) -> str:
    """The table as Markdown; the paper's rows stand below, for reference, outside the ranking."""
    ours, theirs = main_table(rows, metric), paper_rows(metric) if with_paper else {}
    parts: list[str] = []
    for mode, methods in ours.items():
        sets = list(dict.fromkeys(name for row in methods.values() for name in row))
        lines = [
            f"**{mode}** ({METRICS[metric]}; best bold, second underlined)",
            "",
            "| method | " + " | ".join(sets) + " | cases | worst |",
            "|" + " --- |" * (len(sets) + 3),
        ]
        places = {
            name: ranks({method: row[name].mean for method, row in methods.items() if name in row}) for name in sets
        }
        for method, row in methods.items():
            entries = [_marked(str(row[name]), places[name].get(method)) if name in row else "" for name in sets]
            lines.append(f"| {method} | " + " | ".join(entries) + f" | {_cases(row)} |")
        for method, row in theirs.get(mode, {}).items():
            entries = [str(row[name]) if name in row else "" for name in sets]
            lines.append(f"| *{method}* | " + " | ".join(entries) + " | 100 | |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _cases(row: dict[str, Statistic]) -> str:
    worst = np.nanmax([entry.worst for entry in row.values()] or [math.nan])
    return f"{sum(entry.count for entry in row.values())} | {_short(float(worst))}"


def ranks(means: Mapping[str, float]) -> dict[str, int]:
    """Places by mean, 0 the smallest; equal means share a place, and NaN has none."""
    known = {method: mean for method, mean in means.items() if not math.isnan(mean)}
    places = sorted(set(known.values()))
    return {method: places.index(mean) for method, mean in known.items()}


def _marked(text: str, rank: int | None) -> str:
    if rank == 0:
        return f"**{text}**"
    return f"<u>{text}</u>" if rank == 1 else text


def rows_of(records: Sequence[CellRecord]) -> list[dict[str, Any]]:
    """One flat row a cell, for CSV."""
    return [
        {
            "case": record.case,
            "mode": record.mode,
            "parameter_set": record.parameter_set,
            "rates": record.rates,
            "method": record.method,
            "status": record.status,
            **{name: record.metric(name) for name in REPORTED},
            "initial_mape": math.nan if record.initial is None else record.initial["mape"],
            "early_mape": record.best_mape_after(EARLY),
            "simulations": record.simulations,
            "failed_simulations": record.failed_simulations,
            "wall_s": record.wall_s,
            "simulator_s": record.simulator_s,
            "proposer_s": record.proposer_s,
            "backend_s": record.backend_s,
            "tokens": record.tokens,
            "note": record.note,
        }
        for record in records
    ]


def read_csv(path: Path) -> list[dict[str, Any]]:
    """Rows that `write_csv` wrote: numbers as floats, an empty field as NaN, anything else as text."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{key: _number_or_text(value) for key, value in row.items()} for row in csv.DictReader(file)]


def _number_or_text(text: str) -> float | str:
    try:
        return float(text or "nan")
    except ValueError:
        return text


def write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write flat rows; numbers in full, nothing known as an empty field."""
    files.write_csv(path, [{key: "" if _is_nan(value) else value for key, value in row.items()} for row in rows])


def write_json(path: Path, content: Any) -> None:
    """Write JSON that every reader takes: NaN and infinity become null."""
    files.write_json(path, _finite(content), indent=2)


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
