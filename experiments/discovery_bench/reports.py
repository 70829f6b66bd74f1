"""Discrepancy reports with the effect that hides behind each: what a backend is shown when it is to rank effects."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...core.contracts.effect_choice import effects_of
from ...core.files import read_json, write_json
from ...core.run.journal import FORMAT, Journal, read_events
from ...core.run.recording import Recorder
from ...core.run.run_config import hash_of
from ...core.shape import decoding, shaped
from ..campaign.cell import Axes
from ..campaign.grid_file import BackendChoice
from ..campaign.identity import versions_of_study, without_placement
from ..campaign.study_cell import StudyCell
from .results import read_results
from .shortlists import HOW, SHORTLISTS, place_of, rankings

PACKAGED = Path(__file__).parent / "packaged" / "reports.json"
"""24 reports: those of 27 cases of ``bsa bench discovery make --short --seed 24`` that leave something."""


@dataclass(frozen=True)
class Report:
    """What a fit of the base model left of one case."""

    name: str  # Of the case.
    hidden: str  # Name of the effect that was hidden in its records.
    effects: tuple[str, ...]  # Keys of the effects that the records can show.
    by_score: tuple[str, ...]  # Those that the score test nominates, the best first.
    discrepancy: tuple[str, ...]  # Sentences.


def read_reports(path: Path) -> list[Report]:
    """The reports of a file that `write_reports` made. Raises `BsaError` if it is no such file."""
    with decoding(path, "a file of discrepancy reports", "bsa bench discovery shortlist makes one."):
        return [shaped(Report, row) for row in (read_json(path) or {})["reports"]]


def write_reports(folder: Path, path: Path) -> None:
    """Open the answers of a folder of blind cases, and keep the reports of those that hide one effect of the catalogue.

    ``shortlist`` was run on them. Cases whose base model leaves noise only have no report.
    """
    found = [
        Report(task, answer["names"][0], *(tuple(result[key]) for key in ("possible", "statistics", "discrepancy")))
        for task, _, result, answer in read_results(folder, SHORTLISTS)
        if result.get("discrepancy") and len(answer["names"]) == 1
    ]
    write_json(path, {"reports": [asdict(report) for report in found]}, indent=1)


def ranking_cell(report: Report, backend: BackendChoice, seed: int) -> StudyCell:
    """A report that a backend ranks, as a cell; the seed is for effects' order, their hidden names, and sampling."""
    determining = {
        "report": asdict(report),
        "backend": backend.use,
        "options": without_placement(backend.options),
        "seed": seed,
        "versions": versions_of_study((("backend", backend.use.partition(":")[0]),)),
    }
    axes = Axes(task=report.name, mode="report", scaffold="ranking", backend=backend.use, seed=seed)
    asked = {"report": report, "backend": backend, "seed": seed}
    return StudyCell(axes, rank, asked, hash_of(determining))


def rank(folder: Path, report: Report, backend: BackendChoice, seed: int) -> dict[str, Any]:
    """Rank with names and without; what was answered before a stop is not asked again."""
    from ...backends.opening import open_backend

    effects = effects_of(report.effects)
    with closing(Journal(folder)) as journal:
        earlier = list(read_events(folder))
        if not earlier:
            journal.append("run", format=FORMAT, kind="ranking")
        recorder = Recorder(journal, earlier)
        with closing(recorder.around(open_backend(backend.use, backend.options))) as model:
            found = rankings(model, report.discrepancy, effects, seed)
        spent = recorder.usage
    return {
        **found,
        "replies": sum(map(bool, found.values())),
        "llm_calls": recorder.calls,
        "lost_calls": recorder.lost,
        "tokens": spent.tokens,
        "cost_usd": spent.cost_usd,
        "backend_s": spent.seconds,
    }


def places(report: Report, result: Mapping[str, Any]) -> dict[str, float]:
    """The place that each ranking of a report gives the hidden effect; infinite where it is not named."""
    ranked: Mapping[str, Sequence[str]] = {"by_score": report.by_score, **{how: result[how] for how in HOW}}
    return {how: place_of(keys, {report.hidden}) for how, keys in ranked.items()}
