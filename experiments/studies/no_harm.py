"""``bsa bench no-harm``: whatever the model says, hybrid ends no worse than least squares on a smaller budget.

The idea is that of Xu, Adachi, Jones & Osborne, NeurIPS 2024 (arXiv:2410.10452): advice may help, and bad
advice may cost a bounded share of the budget, but never the result. Here it is measured.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from ...core.files import write_csv, write_text
from ...core.scaffold import Scaffold
from ..campaign.grid_file import BackendChoice, GridFile, Included, SuiteFilter
from ..campaign.store import Store
from ..campaign.summary import Row, grouped, statistic
from ..campaign.text_tables import table_of
from .grids import budget, study_grid, trace_of

ADVISERS = ("rules", "random-advice", "adversarial-advice")
"""Backends of the hybrid: one that reasons, and random and adversarial advice."""

MORE = 1.25
"""Simulations of the hybrid, as a multiple of those of least squares."""

_SAME = 1e-3
"""Total MAPE, in percentage points, that nobody could measure.

A simulation that follows a failed one in the same process differs in its tenth digit, and a fit that goes on from
it ends elsewhere on the floor: seen were 0.0010 % in place of 0.0009 %.
"""

_SCORE_TOLERANCE = 0.05
"""Total MAPE, in percentage points, by which final scores may differ for the mesh's sake.

The search sees a mesh that shifts voltages by up to 0.65 mV, about 0.02 % of a voltage, against the mesh of the
final score; what is better on one may be that much worse on the other.
"""


@dataclass(frozen=True)
class Verdict:
    """One case with one adviser, against least squares."""

    # task, chemistry, rates, adviser: Which pair it is.
    task: str
    chemistry: str
    rates: str
    adviser: str
    # alone, advised: Lowest total MAPE of the search in percent, of least squares and of the hybrid; NaN if nothing
    # ran.
    alone: float
    advised: float
    # alone_score, advised_score: The same with reference accuracy.
    alone_score: float
    advised_score: float

    @property
    def no_worse(self) -> bool:
        """Whether the hybrid's search got as low, to 0.001 points: what the construction promises."""
        return _no_higher(self.advised, self.alone, _SAME)

    @property
    def score_no_worse(self) -> bool:
        """Whether its final score is no higher either, up to the difference of the meshes."""
        return _no_higher(self.advised_score, self.alone_score, _SCORE_TOLERANCE)

    @property
    def better(self) -> bool:
        """Whether the hybrid's search got lower."""
        return self.advised < self.alone - _SAME

    @property
    def words(self) -> str:
        """The comparison in words."""
        return "better" if self.better else "equal" if self.no_worse else "**worse**"

    @property
    def harm(self) -> float:
        """Percentage points by which the hybrid's search stayed above that of least squares; 0 if it did not.

        Infinite where the hybrid alone has no result: NaN would be the largest of several harms or not by their order.
        """
        if math.isnan(self.alone):
            return 0.0
        return math.inf if math.isnan(self.advised) else max(self.advised - self.alone, 0.0)

    @property
    def row(self) -> dict[str, Any]:
        """The pair as a flat row, for CSV."""
        return {**asdict(self), "no_worse": self.no_worse, "score_no_worse": self.score_no_worse}


def verdict_of(row: Row) -> Verdict:
    """The pair of a row that `Verdict.row` made."""
    return Verdict(**{field.name: row[field.name] for field in fields(Verdict)})


def no_harm_grid(
    cases: SuiteFilter,
    simulations: int = 100,
    seed: int = 1234,
    alone: str | Scaffold = "least-squares",
    advised: str | Scaffold = "hybrid",
) -> GridFile:
    """Every case by least squares, and by the hybrid with every adviser and a quarter more simulations."""
    more = Included(
        scaffolds=[advised],
        backends=[BackendChoice(use=adviser) for adviser in ADVISERS],
        **budget(int(MORE * simulations)),
    )
    return study_grid("no-harm", cases, [alone], BackendChoice(use="rules"), simulations, seed, include=[more])


def write_no_harm(rows: Sequence[Row], store: Store, out: Path) -> list[Verdict]:
    """Compare the hybrid with least squares, case by case: ``no_harm.md`` and ``verdicts.csv``."""
    lowest = {row["identity"]: trace_of(row, store).best_after(row["simulations"]) for row in _ran(rows)}
    found = verdicts(rows, lowest)
    write_text(out / "no_harm.md", markdown(found))
    write_csv(out / "verdicts.csv", [verdict.row for verdict in found])
    return found


def _ran(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["state"] == "done"]


def verdicts(rows: Sequence[Row], lowest: Mapping[str, float | None]) -> list[Verdict]:
    """Pair every cell of the hybrid with the case's cell of least squares; pairs that have not run are left out.

    Of the rows of `no_harm_grid` the first method is the reference; ``lowest`` is the lowest error of each cell's
    search, by identity.
    """
    reference = rows[0]["scaffold"] if rows else ""
    references = {row["task"]: row for row in _ran(rows) if row["scaffold"] == reference}
    found: list[Verdict] = []
    for row in _ran(rows):
        if row["scaffold"] == reference or row["task"] not in references:
            continue
        pair = (references[row["task"]], row)
        searched = (_number(lowest[one["identity"]]) for one in pair)
        scored = (_number(one["mape"]) for one in pair)
        found.append(Verdict(row["task"], row["chemistry"], row["rates"], row["backend"], *searched, *scored))
    return found


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _no_higher(value: float, reference: float, tolerance: float) -> bool:
    """A run without a result is no worse than another without one, and worse than any that has one."""
    return math.isnan(reference) or value <= reference + tolerance


def summary(found: Sequence[Verdict]) -> list[dict[str, Any]]:
    """Counts and means by adviser, a row each."""
    return [
        {
            "adviser": adviser,
            "cases": len(mine),
            "no_worse": sum(verdict.no_worse for verdict in mine),
            "better": sum(verdict.better for verdict in mine),
            "score_no_worse": sum(verdict.score_no_worse for verdict in mine),
            "largest_harm_points": max(verdict.harm for verdict in mine),
            "alone": statistic([verdict.alone_score for verdict in mine]),
            "advised": statistic([verdict.advised_score for verdict in mine]),
        }
        for adviser, mine in grouped(found, "adviser").items()
    ]


_BY_ADVISER = {
    "adviser": "{adviser}",
    "cases": "{cases}",
    "no worse": "{no_worse}",
    "better": "{better}",
    "score no worse": "{score_no_worse}",
    "largest harm / points": "{largest_harm_points:.3g}",
    "hybrid": "{advised}",
    "least squares": "{alone}",
}
_BY_CASE = {
    "case": "{task}",
    "set": "{chemistry}",
    "rates": "{rates}",
    "adviser": "{adviser}",
    "verdict": "{words}",
    "hybrid": "{advised:.4g}",
    "least squares": "{alone:.4g}",
    "hybrid, score": "{advised_score:.4g}",
    "least squares, score": "{alone_score:.4g}",
}


def markdown(found: Sequence[Verdict]) -> str:
    """The table by adviser, then every case."""
    words = (
        f"The hybrid has {MORE:g} times the simulations of least squares. Total MAPE in %; the search's own errors "
        f"decide, and scores are those on the standard mesh (no worse within {_SCORE_TOLERANCE:g} points)."
    )
    return f"{words}\n\n{table_of(summary(found), _BY_ADVISER)}\n\n{table_of(found, _BY_CASE, 5)}\n"
