"""``bsa bench no-harm``: whatever the model says, hybrid ends no worse than least squares on a smaller budget.

The idea is that of Xu, Adachi, Jones & Osborne, NeurIPS 2024 (arXiv:2410.10452): advice may help, and bad
advice may cost a bounded share of the budget, but never the result. Here it is measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...core.files import write_text
from ...core.scaffold import Scaffold
from ..suite.case import SuiteCase
from .cell import CellRecord, StudyCell, study_config
from .many import Say, run_cells
from .table import rows_of, statistic, write_csv, write_json

ADVISERS = ("rules", "random-advice", "adversarial-advice")
"""Backends of the hybrid: one that reasons, and two that deserve no trust."""

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
    """One case with one adviser, against least squares.

    Attributes
    ----------
    case, parameter_set, rates, adviser : str
        Which pair it is.
    alone, advised : float
        Lowest total MAPE of the search in percent, of least squares and of the hybrid; NaN if nothing ran.
    alone_score, advised_score : float
        The same with reference accuracy.
    no_worse : bool
        Whether the hybrid's search got as low, to 0.001 points: what the construction promises.
    score_no_worse : bool
        Whether its final score is no higher either, up to the difference of the meshes.
    """

    case: str
    parameter_set: str
    rates: str
    adviser: str
    alone: float
    advised: float
    alone_score: float
    advised_score: float
    no_worse: bool
    score_no_worse: bool


def no_harm_study(
    cases: Iterable[SuiteCase],
    out: Path,
    simulations: int = 100,
    workers: int = 2,
    seed: int = 1234,
    advisers: Sequence[str] = ADVISERS,
    alone: str | Scaffold = "least-squares",
    advised: str | Scaffold = "hybrid",
    say: Say = print,
) -> list[Verdict]:
    """Fit every case by least squares, and by the hybrid with every adviser; write tables and verdicts.

    Writes ``no_harm.md``, ``no_harm.json``, ``verdicts.csv`` and ``cells.csv``.

    Parameters
    ----------
    cases : iterable of SuiteCase
        From `load_suite` and `choose`.
    out : Path
        The study's folder; finished cells in it are not run again.
    simulations : int
        Simulations of least squares at most; the hybrid may take a quarter more.
    workers, seed, say
        As in `suite_study`.
    advisers : sequence of str
        Backends of the hybrid.
    alone, advised : str or Scaffold
        The two scaffolds.
    """
    cells: list[StudyCell] = []
    more = int(MORE * simulations)
    for case in cases:
        cells.append(StudyCell(case, "least-squares", study_config(alone, simulations, seed, "rules", {})))
        cells += [
            StudyCell(case, f"hybrid-{adviser}", study_config(advised, more, seed, adviser, {})) for adviser in advisers
        ]
    records = run_cells(cells, out, workers, say)
    found = verdicts(records)
    write_text(out / "no_harm.md", markdown(found, simulations))
    write_csv(out / "cells.csv", rows_of(records))
    write_csv(out / "verdicts.csv", [asdict(verdict) for verdict in found])
    write_json(out / "no_harm.json", {"simulations": simulations, "hybrid_simulations": more, **summary(found)})
    say(f"Written to {out}: no_harm.md, no_harm.json, verdicts.csv, cells.csv.")
    return found


def verdicts(records: Sequence[CellRecord]) -> list[Verdict]:
    """Pair every hybrid's cell with the case's cell of least squares; cases without a target are left out."""
    references = {record.case: record for record in records if record.method == "least-squares"}
    found: list[Verdict] = []
    for record in records:
        reference = references[record.case]
        if record is reference or record.status == "no target":
            continue
        alone, advised = _lowest(reference), _lowest(record)
        alone_score, advised_score = reference.metric("mape"), record.metric("mape")
        found.append(
            Verdict(
                record.case,
                record.parameter_set,
                record.rates,
                record.method.removeprefix("hybrid-"),
                alone,
                advised,
                alone_score,
                advised_score,
                _no_higher(advised, alone, _SAME),
                _no_higher(advised_score, alone_score, _SCORE_TOLERANCE),
            )
        )
    return found


def _lowest(record: CellRecord) -> float:
    return min((trial.mape for trial in record.trials if trial.mape is not None), default=math.nan)


def _no_higher(value: float, reference: float, tolerance: float) -> bool:
    """A run without a result is no worse than another without one, and worse than any that has one."""
    return math.isnan(reference) or value <= reference + tolerance


def summary(found: Sequence[Verdict]) -> dict[str, Any]:
    """Counts and means by adviser."""
    content: dict[str, Any] = {}
    for adviser in dict.fromkeys(verdict.adviser for verdict in found):
        mine = [verdict for verdict in found if verdict.adviser == adviser]
        content[adviser] = {
            "cases": len(mine),
            "no_worse": sum(verdict.no_worse for verdict in mine),
            "score_no_worse": sum(verdict.score_no_worse for verdict in mine),
            "better": sum(verdict.advised < verdict.alone - _SAME for verdict in mine),
            "largest_harm_points": max((_harm(verdict) for verdict in mine), default=math.nan),
            "alone": asdict(statistic([verdict.alone_score for verdict in mine])),
            "advised": asdict(statistic([verdict.advised_score for verdict in mine])),
        }
    return content


def _harm(verdict: Verdict) -> float:
    """Percentage points by which the hybrid's search stayed above that of least squares; 0 if it did not."""
    return max(verdict.advised - verdict.alone, 0.0) if not math.isnan(verdict.alone) else 0.0


def markdown(found: Sequence[Verdict], simulations: int) -> str:
    """The table by adviser, then every case."""
    lines = [
        f"Least squares with {simulations} simulations at most, hybrid with {int(MORE * simulations)}. "
        "Total MAPE in %; the search's own errors decide, and scores are those on the standard mesh "
        f"(no worse within {_SCORE_TOLERANCE:g} points).",
        "",
        "| adviser | cases | no worse | better | score no worse | largest harm / points | hybrid | least squares |",
        "|" + " --- |" * 8,
    ]
    for adviser, entry in summary(found).items():
        lines.append(
            f"| {adviser} | {entry['cases']} | {entry['no_worse']} | {entry['better']} | {entry['score_no_worse']} "
            f"| {entry['largest_harm_points']:.3g} | {_mean(found, adviser, True)} | {_mean(found, adviser, False)} |"
        )
    lines += [
        "",
        "| case | set | rates | adviser | hybrid | least squares | verdict | hybrid, score | least squares, score |",
        "|" + " --- |" * 9,
    ]
    for verdict in found:
        word = "better" if verdict.advised < verdict.alone - _SAME else "equal" if verdict.no_worse else "**worse**"
        lines.append(
            f"| {verdict.case} | {verdict.parameter_set} | {verdict.rates} | {verdict.adviser} "
            f"| {verdict.advised:.4g} | {verdict.alone:.4g} | {word} "
            f"| {verdict.advised_score:.4g} | {verdict.alone_score:.4g} |"
        )
    return "\n".join(lines) + "\n"


def _mean(found: Sequence[Verdict], adviser: str, advised: bool) -> str:
    mine = [verdict for verdict in found if verdict.adviser == adviser]
    return str(statistic([verdict.advised_score if advised else verdict.alone_score for verdict in mine]))
