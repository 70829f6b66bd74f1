"""The results of a grid as one tidy table, a row a cell, in CSV and Parquet."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.errors import BsaError
from ...core.files import begins, entries, foreign, read_json, replacing, write_csv, write_json
from ...core.journal import read_events
from ...core.metrics import PaperMetrics
from ...core.shape import decoding, shaped
from .expansion import GridCell
from .grid_file import GridFile
from .one_cell import Report
from .store import FAILURE, FINAL, MANIFEST, OUTAGE, TRACE, Store, read_result

Row = dict[str, Any]

_BEGINNING = b'{"grid": {'
"""How every manifest begins."""

_METRICS = tuple(PaperMetrics.__dataclass_fields__)
_SPENT = (
    "simulations",
    "failed_simulations",
    "llm_calls",
    "lost_calls",
    "tokens",
    "cost_usd",
    "wall_s",
    "simulator_s",
    "backend_s",
)


def write_manifest(grid: GridFile, cells: Sequence[GridCell], store: Store) -> Path:
    """Note which cells a grid has, so that tables and pages need neither its file nor this version of the code.

    Returns
    -------
    Path
        The grid's folder.
    """
    methods = _methods(cells)
    entries = [
        {"identity": cell.identity, "method": methods[cell.scaffold, cell.backend.use], **cell.axes, **_label(cell)}
        for cell in cells
    ]
    folder = store.grid(grid.name)
    content = {"grid": grid.model_dump(mode="json"), "cells": entries, "methods": list(dict.fromkeys(methods.values()))}
    write_json(folder / MANIFEST, content)
    return folder


_AGAIN = "run bsa grid again; finished cells are kept."


@dataclass(frozen=True)
class _Entry:
    identity: str
    method: str
    task: str
    mode: str
    chemistry: str
    rates: str
    scaffold: str
    backend: str
    seed: int
    trouble: str


@dataclass(frozen=True)
class _Grid:
    name: str
    summary: str = ""
    reference: str | None = None


@dataclass(frozen=True)
class _Manifest:
    grid: _Grid
    cells: list[_Entry]
    methods: list[str]


def check_grid_folder(folder: Path) -> None:
    """Refuse a folder that holds anything else than a grid; nothing is written.

    Raises
    ------
    BsaError
        If there are files without a manifest of ours.
    """
    if entries(folder) and not begins(folder / MANIFEST, _BEGINNING):
        raise foreign(folder, "a grid")


def _label(cell: GridCell) -> dict[str, Any]:
    return {"seed": cell.config.seed, "trouble": cell.task.trouble}


def _methods(cells: Sequence[GridCell]) -> dict[tuple[str, str], str]:
    """What a row of a table is called: the scaffold, with the backend where it does not go without saying."""
    backends: dict[str, list[str]] = {}
    for cell in cells:
        names = backends.setdefault(cell.scaffold, [])
        if cell.backend.use not in names:
            names.append(cell.backend.use)
    alone = len(backends) == 1
    return {
        (scaffold, name): scaffold if len(names) == 1 else name if alone else f"{scaffold} · {name}"
        for scaffold, names in backends.items()
        for name in names
    }


def grid_folder(grid: str | Path, store: Store) -> Path:
    """The folder of a grid that was run, by its name, its file or its folder.

    Raises
    ------
    BsaError
        If no such grid was run in this store.
    """
    path = Path(grid)
    if (path / MANIFEST).is_file():
        return path
    name = str(grid)
    if path.suffix in (".yaml", ".yml"):
        from .grid_file import load_grid

        name = load_grid(name).name
    folder = store.grid(name)
    if not (folder / MANIFEST).is_file():
        raise BsaError(f'the grid "{name}" has not been run in {store.root}.', f"bsa grid {grid} runs it; or --store.")
    return folder


def read_manifest(folder: Path) -> dict[str, Any]:
    """What `write_manifest` noted.

    Raises
    ------
    BsaError
        If it is missing or damaged.
    """
    content = read_json(folder / MANIFEST)
    if content is None:
        raise BsaError(f"{folder / MANIFEST} is missing or damaged.", _AGAIN)
    with decoding(folder / MANIFEST, "a grid", _AGAIN):
        shaped(_Manifest, content)
    return content


def rows_of(manifest: Mapping[str, Any], store: Store, reports: Mapping[str, Report] | None = None) -> list[Row]:
    """A flat row for every cell of a grid, whatever became of it.

    Parameters
    ----------
    manifest : mapping
        From `read_manifest`.
    store : Store
        Where results lie.
    reports : mapping, optional
        What this process saw, so that results need not be read again.
    """
    return [
        _row(str(manifest["grid"]["name"]), entry, store, (reports or {}).get(entry["identity"]))
        for entry in manifest["cells"]
    ]


def _row(grid: str, entry: Mapping[str, Any], store: Store, report: Report | None) -> Row:
    folder = store.cell(entry["identity"])
    result = report.result if report is not None and report.result else None
    if result is None and entry["identity"]:
        result = read_result(folder)
    state, reason = _state(entry, folder, result, report)
    # How many calls were lost is told of a cell that failed for it, too.
    lost_calls = (result or {}).get("lost_calls")
    result = result if state == "done" else None
    best, initial = (result or {}).get("best") or {}, (result or {}).get("initial") or {}
    return {
        "grid": grid,
        **{name: entry[name] for name in ("task", "mode", "chemistry", "rates", "method", "scaffold", "backend")},
        "seed": entry["seed"],
        "state": state,
        "status": (result or {}).get("status", ""),
        **{name: _float(best.get(name)) for name in _METRICS},
        **{f"initial_{name}": _float(initial.get(name)) for name in ("objective", "mape", "v_rmse_mv")},
        **{name: (result or {}).get(name) for name in _SPENT},
        "lost_calls": lost_calls,
        "best_simulation": best.get("trial"),
        "identity": entry["identity"],
        "reason": reason,
    }


def _state(
    entry: Mapping[str, Any], folder: Path, result: Mapping[str, Any] | None, report: Report | None
) -> tuple[str, str]:
    if not entry["identity"]:
        return ("failed", str(entry["trouble"])) if entry["trouble"] else ("missing", "")
    if report is not None and report.state in ("failed", "lost"):
        return "failed", report.reason
    if result is not None and result.get("status") != OUTAGE:
        return ("done", "") if result.get("status") in FINAL else ("stopped", str(result.get("status")))
    failure = read_json(folder / FAILURE)
    return ("failed", str(failure.get("reason"))) if failure is not None else ("missing", "")


def _float(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


@dataclass(frozen=True)
class _Trace:
    objective: list[float | None]


def trace_of(store: Store, identity: str) -> list[float | None]:
    """The objective of every simulation of a cell, in order; None for a failed one."""
    folder = store.cell(identity)
    kept = read_json(folder / TRACE)
    with suppress(ValueError):
        trace: _Trace = shaped(_Trace, kept)
        return trace.objective
    # A run that was killed after its result and before its trace, or that bsa run made.
    found: dict[int, float | None] = {}
    for event in read_events(folder):
        if event["event"] == "trial":
            good = event["failure"] is None and event["metrics"] is not None
            found[event["index"]] = event["metrics"]["objective"] if good else None
    return [found[index] for index in sorted(found)]


def write_rows(rows: Sequence[Row], folder: Path) -> list[str]:
    """Write ``cells.csv`` and ``cells.parquet``.

    Returns
    -------
    list of str
        What could not be written, and what would make it so.
    """
    write_csv(folder / "cells.csv", rows)
    if importlib.util.find_spec("pyarrow") is None:
        return ['cells.parquet needs pyarrow, which is not installed: pip install "battery-sim-agent[cluster]"']
    import pyarrow
    from pyarrow import parquet

    with replacing(folder / "cells.parquet") as file:
        parquet.write_table(pyarrow.Table.from_pylist(list(rows), schema=_schema(pyarrow)), file)
    return []


def _schema(pyarrow: Any) -> Any:
    """Types by column: a column without a value would otherwise have none."""
    text, real, whole = pyarrow.string(), pyarrow.float64(), pyarrow.int64()
    counts = {"seed", "best_simulation", "simulations", "failed_simulations", "llm_calls", "lost_calls", "tokens"}
    names = list(_row("", dict.fromkeys(_AXES, ""), Store(Path()), None))
    reals = {*_METRICS, *(name for name in names if name.startswith("initial_")), *_SPENT} - counts
    return pyarrow.schema([(name, whole if name in counts else real if name in reals else text) for name in names])


_AXES = ("identity", "method", "task", "mode", "chemistry", "rates", "scaffold", "backend", "seed", "trouble")
