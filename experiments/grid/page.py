"""A grid on one page: sortable, filterable, with every run's story, figures and comparisons; it needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from ...core.errors import BsaError
from ...core.files import write_text
from ...core.reply_parsing import strip_control
from ..own_pages import check_page
from ..report import build_report
from ..report.wording import clipped, number, quantity, short_name
from ..story import Round, read_run
from .figures import draw_all
from .results import Row, grid_folder, read_manifest, rows_of
from .statistics import compare
from .store import Store
from .tables import RESULTS, Block, blocks, check_metric, compared_metric, effort, label_of, reference_of, shown_metrics

if TYPE_CHECKING:
    import jinja2

FILE_NAME = "index.html"

MOST_STORIES = 1500
"""Stories are part of the page up to so many cells (about 5 kB each); beyond, it only links to reports."""

_COLUMNS = (
    "task",
    "mode",
    "chemistry",
    "rates",
    "method",
    "seed",
    "state",
    "status",
    "mape",
    "rmse",
    "v_rmse_mv",
    "capacity_error",
    "initial_mape",
    "simulations",
    "failed_simulations",
    "tokens",
    "cost_usd",
    "wall_s",
    "reason",
    "identity",
)
_CAPTIONS = {
    "by-mode": "Errors by mode: a box from quartile to quartile with its median, a dot a cell.",
    "by-chemistry": "Errors by chemistry.",
    "by-rate": "Errors by rate, charge/discharge.",
    "convergence": "Best error so far by simulations: median, with a band from quartile to quartile.",
    "effort": "Median error against effort, with quartiles; the dashed line joins what nothing beats in both.",
}


def build_page(
    grid: str | Path, store: Path = RESULTS, out: Path | None = None, full: bool = False, metric: str = "mape"
) -> Path:
    """Write the page of a grid: ``bsa report GRID``.

    Each run's story (hypotheses, changes, errors) is part of the page. The run's own report with its curves is
    a file beside its journal: the page links to those that exist.

    Parameters
    ----------
    grid : str or Path
        Name, file or folder of a grid that was run, finished or not.
    store : Path
        The store that it was run in.
    out : Path, optional
        The page; ``index.html`` in the grid's folder by default.
    full : bool
        Whether the report of every finished run is written first.
    metric : str
        The error that is compared and drawn.

    Raises
    ------
    BsaError
        If the grid has not been run in this store.
    """
    check_metric(metric)
    if out is not None:
        check_page(out)
    place = Store(store)
    folder = grid_folder(grid, place)
    manifest = read_manifest(folder)
    rows = rows_of(manifest, place)
    metric = compared_metric(rows, metric)
    path = out or folder / FILE_NAME
    if full:
        for row in rows:
            if row["state"] == "done":
                build_report(place.cell(row["identity"]))
    reference = reference_of(manifest["grid"].get("reference"), manifest["methods"])
    page = _template().render(
        name=manifest["grid"]["name"],
        summary=manifest["grid"].get("summary", ""),
        rows=rows,
        done=sum(row["state"] == "done" for row in rows),
        tasks=len({row["task"] for row in rows}),
        seeds=len({row["seed"] for row in rows}),
        methods=manifest["methods"],
        tables=[_ranked(block) for name in shown_metrics(rows) for block in blocks(rows, name)],
        comparisons=compare(rows, reference, metric),
        reference=reference,
        metric=label_of(metric),
        effort=effort(rows),
        figures=[(_CAPTIONS[name], Markup(svg)) for name, svg in draw_all(rows, place, metric).items()],
        data=_json({"columns": _COLUMNS, "rows": [[row[name] for name in _COLUMNS] for row in rows]}),
        stories=_json(_stories(rows, place, path.parent)),
        script=Markup(_script()),
        script_hash=_hash(_script()),
        grid=json.dumps(manifest["grid"], indent=2, ensure_ascii=False),
    )
    write_text(path, page)
    return path


def _ranked(block: Block) -> dict[str, Any]:
    ranks = [block.ranks(column) for column in range(len(block.columns))]
    return {
        "title": block.title,
        "columns": block.columns,
        "rows": [
            (method, [(value, rank.get(method)) for value, rank in zip(row, ranks, strict=True)])
            for method, row in block.rows
        ],
    }


def _stories(rows: Sequence[Row], store: Store, here: Path) -> dict[str, Any]:
    told = [row for row in rows if row["identity"] and row["state"] in ("done", "stopped")]
    embed = len(told) <= MOST_STORIES
    stories: dict[str, Any] = {}
    for row in told:
        folder = store.cell(row["identity"])
        try:
            story = _story(folder) if embed else {}
        except BsaError:
            continue  # a run without a single simulation tells nothing
        if (folder / "report.html").is_file():
            story["report"] = Path(os.path.relpath(folder / "report.html", here)).as_posix()
        if story:
            stories[row["identity"]] = story
    return stories


def _story(folder: Path) -> dict[str, Any]:
    run = read_run(folder)
    best, initial = run.best, run.initial
    return {
        "trace": [None if trial.failure else _rounded(trial.objective) for trial in run.trials],
        "rounds": [_round(item) for item in run.rounds],
        "parameters": [
            [
                short_name(parameter.name),
                quantity(initial.candidate[parameter.name], parameter.unit),
                quantity(best.candidate[parameter.name], parameter.unit),
            ]
            for parameter in run.task.space
        ],
        "notes": [_words(note, 200) for note in run.notes[:5]],
    }


def _round(item: Round) -> dict[str, Any]:
    best = item.best
    return {
        "phase": item.phase,
        "number": item.number,
        "words": _words(f"lost: {item.lost}" if item.lost else item.hypothesis or item.rationale or item.action, 280),
        "updates": _words(", ".join(f"{short_name(name)} {value}" for name, value in item.updates.items()), 280),
        "simulations": len(item.trials),
        "best": None if best is None or not best.ok else _rounded(best.objective),
        "improved": item.improved,
    }


def _words(text: str, most: int) -> str:
    return clipped(" ".join(strip_control(text).split()), most)


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


@cache
def _template() -> jinja2.Template:
    import jinja2

    rooms = [Path(__file__).parent, Path(__file__).parent.parent / "report"]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(rooms),
        autoescape=True,
        finalize=lambda value: (
            strip_control(value) if isinstance(value, str) and not isinstance(value, Markup) else value
        ),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(number=number)
    return environment.get_template("page.html.j2")
