"""What many cells come to: mean and spread by mode, method and chemistry; and the paper's rows in the same form."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...core.yaml_text import read_yaml

PAPER_ROWS_FILE = Path(__file__).with_name("paper_rows.yaml")

Item = TypeVar("Item")

Row = Mapping[str, Any]
"""A row of the results table, or of a file that was made of it."""

_LEAST = 1e-12
"""An error below this is zero: it has no logarithm to be averaged."""


@dataclass(frozen=True)
class Statistic:
    """Mean and standard deviation over the cells of one table entry."""

    # mean, deviation: The deviation has n - 1 in its denominator, as in the paper; NaN for one cell.
    mean: float
    deviation: float
    worst: float  # Largest value.
    count: int  # Cells with a value.
    missing: int = 0  # Cells in which nothing could be compared; they are not in the mean, and are said in the table.

    def __str__(self) -> str:
        spread = "" if math.isnan(self.deviation) else f" ± {short(self.deviation)}"
        return f"{short(self.mean)}{spread}" + (f" ({self.missing} without result)" if self.missing else "")


def short(value: float) -> str:
    """A number as tables show it."""
    if math.isnan(value):
        return "–"
    return f"{value:.2f}" if 0.1 <= value < 1000 or value == 0 else f"{value:.3g}"


def statistic(values: Sequence[float | None]) -> Statistic:
    """Mean, deviation and worst of the values that are numbers."""
    known = np.array([value for value in values if value is not None and not math.isnan(value)])
    if not known.size:
        return Statistic(math.nan, math.nan, math.nan, 0, len(values))
    deviation = float(known.std(ddof=1)) if known.size > 1 else math.nan
    return Statistic(float(known.mean()), deviation, float(known.max()), known.size, len(values) - known.size)


def geometric_mean(values: Iterable[float]) -> float:
    """Of errors; one below 1e-12 counts as that, and of none it is not a number."""
    known = np.array([*values], float)
    return float(np.exp(np.mean(np.log(np.maximum(known, _LEAST))))) if known.size else math.nan


def mean_of(rows: Sequence[Row], name: str) -> float:
    """Mean of a column, of the cells that have a value."""
    return statistic([row[name] for row in rows]).mean


def grouped(rows: Iterable[Item], *names: str) -> dict[Any, list[Item]]:
    """Rows, or objects, by the values of one or more columns, or attributes, in order of appearance."""
    groups: dict[Any, list[Item]] = {}
    for row in rows:
        key = tuple(row[name] if isinstance(row, Mapping) else getattr(row, name) for name in names)
        groups.setdefault(key if len(names) > 1 else key[0], []).append(row)
    return groups


def exact_bounds(count: float, of: float) -> tuple[float, float]:
    """The exact 95 % interval of a share (Clopper and Pearson, Biometrika 26 (1934) 404); counts may be fractions."""
    from scipy.stats import beta

    low = float(beta.ppf(0.025, count, of - count + 1.0)) if count > 0.0 else 0.0
    high = float(beta.ppf(0.975, count + 1.0, of - count)) if count < of else 1.0
    return low, high


def exact_interval(count: int, of: int) -> str:
    """The same in words, in percent."""
    low, high = (f"{100 * end:.2g}".replace("1e+02", "100") for end in exact_bounds(count, of))
    return f"exact 95 % interval {low} to {high} %"


Table = dict[str, dict[str, dict[str, Statistic]]]
"""Statistics by mode, method and chemistry."""


def main_table(rows: Sequence[Row], metric: str = "mape") -> Table:
    """Statistics by mode, method and chemistry, in order of appearance."""
    return {
        mode: {
            method: {
                chemistry: statistic([row[metric] for row in cells])
                for chemistry, cells in grouped(own, "chemistry").items()
            }
            for method, own in grouped(of_mode, "method").items()
        }
        for mode, of_mode in grouped(rows, "mode").items()
    }


def paper_rows(metric: str = "mape") -> Table:
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


def ranks(means: Mapping[str, float]) -> dict[str, int]:
    """Places by mean, 0 the smallest; equal means share a place, and NaN has none."""
    known = {method: mean for method, mean in means.items() if not math.isnan(mean)}
    places = sorted(set(known.values()))
    return {method: places.index(mean) for method, mean in known.items()}
