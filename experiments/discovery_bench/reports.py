"""Discrepancy reports with the effect that hides behind each: what a backend is shown when it is to rank effects."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...core.discovery.ranking import ask
from ...core.files import read_json, write_json
from ...core.journal import Journal, read_events
from ...core.messages import Outage
from ...core.recording import Recorder
from ...core.shape import decoding, shaped
from ..campaign.cell import Axis
from ..campaign.grid_file import BackendChoice
from ..campaign.identity import versions_of, without_placement
from ..campaign.store import RESULT, Store
from ..effect_choice import effects_of
from .results import read_results
from .shortlists import SHORTLISTS, place_of

HOW = {"named": False, "nameless": True}
"""Each report is ranked twice: with the effects' names, and with names without meaning."""


@dataclass(frozen=True)
class Report:
    """What a fit of the base model left of one case.

    Attributes
    ----------
    name : str
        Of the case.
    hidden : str
        Name of the effect that was hidden in its records.
    effects : tuple of str
        Keys of the effects that the records can show.
    by_score : tuple of str
        Those that the score test nominates, the best first.
    discrepancy : tuple of str
        Sentences.
    """

    name: str
    hidden: str
    effects: tuple[str, ...]
    by_score: tuple[str, ...]
    discrepancy: tuple[str, ...]


def read_reports(path: Path) -> list[Report]:
    """The reports of a file that `write_reports` made.

    Raises
    ------
    BsaError
        If it is no such file.
    """
    with decoding(path, "a file of discrepancy reports", "bsa bench discovery shortlist makes one."):
        return [shaped(Report, row) for row in (read_json(path) or {})["reports"]]


def write_reports(folder: Path, path: Path) -> None:
    """Open the answers of a folder of blind cases, and keep the reports of those that hide one effect of the catalogue.

    Parameters
    ----------
    folder : Path
        On whose cases ``shortlist`` was run. Cases whose base model leaves noise only have no report.
    path : Path
        Where they are written.
    """
    found = [
        Report(task, answer["names"][0], *(tuple(result[key]) for key in ("possible", "statistics", "discrepancy")))
        for task, result, answer in read_results(folder, SHORTLISTS)
        if result.get("discrepancy") and len(answer["names"]) == 1
    ]
    write_json(path, {"reports": [asdict(report) for report in found]}, indent=1)


@dataclass(frozen=True)
class RankingCell:
    """A report that a backend ranks; see `Cell`.

    Attributes
    ----------
    report : Report
        What is ranked.
    backend : BackendChoice
        Who ranks.
    seed : int
        For the order of the effects, their hidden names, and sampling.
    trouble : str
        Empty: it can be run.
    """

    report: Report
    backend: BackendChoice
    seed: int
    trouble: str = ""

    @property
    def identity(self) -> str:
        """Hash of the report, the backend and the code."""
        determining = {
            "report": asdict(self.report),
            "backend": self.backend.use,
            "options": without_placement(self.backend.options),
            "seed": self.seed,
            "versions": versions_of((("backend", self.backend.use.partition(":")[0]),)),
        }
        return hashlib.sha256(json.dumps(determining, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def axes(self) -> dict[Axis, str]:
        """What tables group by."""
        return {
            "task": self.report.name,
            "mode": "report",
            "chemistry": "",
            "rates": "",
            "scaffold": "ranking",
            "backend": self.backend.use,
            "seed": str(self.seed),
        }

    def run(self, folder: Path, store: Store) -> dict[str, Any]:
        """See `Cell.run`: rank with names and without; what was answered before a stop is not asked again."""
        from ...backends.opening import open_backend

        effects = effects_of(self.report.effects)
        content: dict[str, Any] = {"status": "finished", "best": {}, "initial": {}, "replies": 0}
        with closing(Journal(folder)) as journal:
            recorder = Recorder(journal, list(read_events(folder)))
            with closing(recorder.around(open_backend(self.backend.use, self.backend.options))) as backend:
                for how, hidden in HOW.items():
                    ranking = ask(backend, self.report.discrepancy, effects, self.seed, hidden)
                    if ranking.lost:
                        raise Outage(ranking.note)
                    content[how] = [ranked.key for ranked in ranking.ranked]
                    content["replies"] += bool(ranking.ranked)
            spent = recorder.usage
        content |= {
            "llm_calls": recorder.calls,
            "lost_calls": recorder.lost,
            "tokens": spent.tokens,
            "cost_usd": spent.cost_usd,
            "backend_s": spent.seconds,
        }
        write_json(folder / RESULT, content)
        return content


def places(report: Report, result: Mapping[str, Any]) -> dict[str, float]:
    """The place that each ranking of a report gives the hidden effect; infinite where it is not named."""
    ranked: Mapping[str, Sequence[str]] = {"by_score": report.by_score, **{how: result[how] for how in HOW}}
    return {how: place_of(keys, {report.hidden}) for how, keys in ranked.items()}
