"""A campaign on one page, which needs nothing else: sortable, filterable, with the rounds of every run."""

import base64
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ...core.errors import BsaError
from ...core.files import write_text
from ...core.printable import one_line
from ..report.page import FILE_NAME as REPORT
from ..report.page import build_report, check_page
from ..report.templates import template
from ..report.wording import quantity, short_name
from ..run_record import Round, read_run
from .columns import COLUMNS, Column
from .figures import draw_all
from .store import Store
from .summary import Row
from .tables import EFFORT, effort, label_of, open_campaign

FILE_NAME = "index.html"

MOST_RUNS = 1500
"""Runs are part of the page up to so many cells (about 5 kB each); beyond, it only links to reports."""

_IDENTITY = next(column for column in COLUMNS if column.name == "identity")
"""It has no head: the page needs it to open a run."""

_CAPTIONS = {
    "by-mode": "Errors by mode: a box from quartile to quartile with its median, a dot a cell.",
    "by-chemistry": "Errors by chemistry.",
    "by-rate": "Errors by rate, charge/discharge.",
    "convergence": "Best error so far in the search, by simulations: median, with a band from quartile to quartile. "
    "It may differ slightly from the final scores.",
    "effort": "Median error against effort, with quartiles; the dashed line joins what nothing beats in both.",
}


def build_page(
    grid: str | Path, store: Path, out: Path | None = None, full: bool = False, metric: str = "mape"
) -> Path:
    """Write the page of a campaign: ``bsa report GRID``.

    The rounds of each run (hypotheses, changes, errors) are part of the page. The run's own report with its curves is a
    file beside its journal: the page links to those that exist. ``full`` writes the report of every finished
    calibration first; ``out`` is ``index.html`` in the campaign's folder by default. Raises `BsaError`: as
    `open_campaign`.
    """
    if out is not None:
        check_page(out)
    campaign = open_campaign(grid, store, metric)
    rows, place = campaign.rows, campaign.store
    path = out or campaign.folder / FILE_NAME
    if full:
        for row in rows:
            if row["state"] == "done":
                with suppress(BsaError):  # a discovery or an item of a study, which have no such report
                    build_report(place.cell(row["identity"]))
    figures = draw_all(rows, place, campaign.metric)
    page = template("page.html.j2", Path(__file__).parent).render(
        name=campaign.about["name"],
        summary=campaign.about.get("summary", ""),
        rows=rows,
        done=sum(row["state"] == "done" for row in rows),
        tasks=len({row["task"] for row in rows}),
        seeds=len({row["seed"] for row in rows}),
        methods=campaign.methods,
        tables=campaign.blocks,
        comparisons=campaign.comparisons,
        reference=campaign.reference,
        metric=label_of(campaign.metric),
        effort=effort(rows),
        effort_heads=list(EFFORT.values()),
        figures=[(_CAPTIONS[name], Markup(svg)) for name, svg in figures.items()],
        data=_json(_shown(rows)),
        runs=_json(_runs(rows, place, path.parent)),
        script=Markup(_script()),
        script_hash=_hash(_script()),
        grid=json.dumps(campaign.about, indent=2, ensure_ascii=False),
    )
    write_text(path, page)
    return path


def _shown(rows: Sequence[Row]) -> dict[str, Any]:
    """Columns of the page with their heads and kinds, and the rows' values of them."""
    shown = [*(column for column in COLUMNS if column.page), _IDENTITY]
    return {
        "columns": [{"name": c.name, "title": c.page, "numeric": c.kind is not str} for c in shown],
        "rows": [[_on_page(row[column.name], column) for column in shown] for row in rows],
    }


def _on_page(value: Any, column: Column) -> Any:
    return value if value is None or column.page_scale == 1.0 else column.page_scale * value


def _runs(rows: Sequence[Row], store: Store, here: Path) -> dict[str, Any]:
    ran = [row for row in rows if row["identity"] and row["state"] in ("done", "stopped")]
    embed = len(ran) <= MOST_RUNS
    runs: dict[str, Any] = {}
    for row in ran:
        folder = store.cell(row["identity"])
        content: dict[str, Any] = {}
        with suppress(BsaError):  # a run without a single simulation tells nothing, and a discovery has no rounds
            content = _run_record(folder) if embed else {}
        if (folder / REPORT).is_file():
            content["report"] = Path(os.path.relpath(folder / REPORT, here)).as_posix()
        if content:
            runs[row["identity"]] = content
    return runs


def _run_record(folder: Path) -> dict[str, Any]:
    run = read_run(folder)
    best, initial = run.best, run.initial
    return {
        "trace": [_rounded(trial.objective) if trial.ok else None for trial in run.trials],
        "rounds": [_round(item) for item in run.rounds],
        "parameters": [
            [
                short_name(parameter.name),
                quantity(initial.candidate[parameter.name], parameter.unit),
                quantity(best.candidate[parameter.name], parameter.unit),
            ]
            for parameter in run.task.space
        ],
        "notes": [one_line(note, 200) for note in run.notes[:5]],
    }


def _round(item: Round) -> dict[str, Any]:
    best = item.best
    return {
        "phase": item.phase,
        "number": item.number,
        "words": one_line(f"lost: {item.lost}" if item.lost else item.hypothesis or item.rationale or item.action, 280),
        "updates": one_line(", ".join(f"{short_name(name)} {value}" for name, value in item.updates.items()), 280),
        "simulations": len(item.trials),
        "best": None if best is None or not best.ok else _rounded(best.objective),
        "improved": item.improved,
    }


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _json(content: Mapping[str, Any]) -> Markup:
    """JSON that no text in it can end early."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


@cache
def _script() -> str:
    return Path(__file__).with_name("page.js").read_text(encoding="utf-8")


def _hash(script: str) -> str:
    """What the page's policy allows to run: this script and no other."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
