"""The results of a campaign as one tidy table, a row a cell, in CSV and Parquet."""

import csv
import importlib.util
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...core.errors import BsaError, did_you_mean
from ...core.files import begins, entries, foreign, read_json, replacing, write_csv, write_json
from ...core.shape import decoding, mapping_with, shaped
from ...core.yaml_text import YAML_SUFFIXES
from .cell import Axes, Cell, Report
from .columns import COLUMNS, Facts
from .store import FAILURE, FINAL, GRIDS, MANIFEST, OUTAGE, Store, read_result
from .summary import Row

_BEGINNING = b'{"grid": {'
"""How every manifest begins."""


def write_manifest(grid: Mapping[str, Any], cells: Sequence[Cell], folder: Path) -> dict[str, Any]:
    """Note which cells a campaign has, so that tables and pages need neither its file nor this version of the code.

    ``grid`` is what the campaign is: its ``name``, and whatever else tells how it was made. Gives what was written.
    """
    axes = [cell.axes for cell in cells]
    methods = _methods(axes)
    entries = [
        {
            "identity": cell.identity,
            "method": methods[own.scaffold, own.backend],
            **asdict(own),
            "trouble": cell.trouble,
        }
        for cell, own in zip(cells, axes, strict=True)
    ]
    manifest = {"grid": grid, "cells": entries, "methods": list(dict.fromkeys(methods.values()))}
    write_json(folder / MANIFEST, manifest)
    return manifest


_AGAIN = "give its command again; finished cells are kept."


@dataclass(frozen=True, kw_only=True)
class _Entry(Axes):
    identity: str
    method: str
    trouble: str


_MANIFEST = mapping_with(
    grid=mapping_with(name=str, summary=(str, ""), reference=(str | None, None)), cells=list[_Entry], methods=list[str]
)


def check_grid_folder(folder: Path) -> None:
    """Refuse a folder that holds anything else than a campaign; nothing is written.

    Raises `BsaError` if there are files without a manifest of ours.
    """
    if entries(folder) and not begins(folder / MANIFEST, _BEGINNING):
        raise foreign(folder, "a campaign")


def _methods(axes: Sequence[Axes]) -> dict[tuple[str, str], str]:
    """What a row of a table is called: the scaffold, with the backend where it does not go without saying."""
    pairs = dict.fromkeys((own.scaffold, own.backend) for own in axes)
    backends = Counter(scaffold for scaffold, _ in pairs)
    alone = len(backends) == 1
    return {
        (scaffold, name): scaffold if backends[scaffold] == 1 else name if alone else f"{scaffold} · {name}"
        for scaffold, name in pairs
    }


def store_of(grid: str | Path, store: Path) -> Store:
    """The store that holds a campaign: of one that is given by its folder, the store that this lies in."""
    folder = Path(grid).absolute()
    inside = (folder / MANIFEST).is_file() and folder.parent.name == GRIDS
    return Store(folder.parent.parent if inside else store)


def grid_folder(grid: str | Path, store: Store) -> Path:
    """The folder of a campaign that was run, by its name, its file or its folder.

    Raises `BsaError` if no such campaign was run in this store.
    """
    path = Path(grid)
    if (path / MANIFEST).is_file():
        return path
    name = str(grid)
    if path.suffix in YAML_SUFFIXES:
        from .grid_file import load_grid

        name = load_grid(name).name
    folder = store.grid(name)
    if not (folder / MANIFEST).is_file():
        raise BsaError(f'the grid "{name}" has not been run in {store.root}.', _what_runs(grid, name, store))
    return folder


def _what_runs(grid: str | Path, name: str, store: Store) -> str:
    """What to do where a campaign is not in the store, as a hint."""
    from .grid_file import shipped_names

    if Path(grid).suffix in YAML_SUFFIXES or name in shipped_names():
        return f"bsa grid {grid} runs it; or --store."
    there = sorted(path.parent.name for path in store.root.glob(f"grids/*/{MANIFEST}"))
    held = f"{', '.join(there)} have been run there" if there else "nothing has been run there"
    return did_you_mean(name, there) or f"{held}; --store names another folder."


def read_manifest(folder: Path) -> dict[str, Any]:
    """What `write_manifest` noted. Raises `BsaError` if it is missing or damaged."""
    content = read_json(folder / MANIFEST)
    if content is None:
        raise BsaError(f"{folder / MANIFEST} is missing or damaged.", _AGAIN)
    with decoding(folder / MANIFEST, "a grid", _AGAIN):
        shaped(_MANIFEST, content)
    return content


def rows_of(manifest: Mapping[str, Any], store: Store, reports: Mapping[str, Report] | None = None) -> list[Row]:
    """A flat row for every cell of a campaign, whatever became of it.

    ``reports`` are what this process saw, so that results need not be read again.
    """
    name = str(manifest["grid"]["name"])
    facts = [_facts(name, entry, store, (reports or {}).get(entry["identity"])) for entry in manifest["cells"]]
    return [{column.name: column.value(known) for column in COLUMNS} for known in facts]


def _facts(campaign: str, entry: Mapping[str, Any], store: Store, report: Report | None) -> Facts:
    folder = store.cell(entry["identity"])
    result = (report.result if report else None) or (read_result(folder) if entry["identity"] else None) or {}
    begun = bool(entry["identity"]) and store.journal_size(entry["identity"]) > 0
    state, reason = _state(entry, folder, result, report, begun)
    return Facts(campaign, entry, state, reason, folder, result if state == "done" else {}, result.get("lost_calls"))


def _state(
    entry: Mapping[str, Any], folder: Path, result: Mapping[str, Any], report: Report | None, begun: bool
) -> tuple[str, str]:
    if not entry["identity"]:
        return ("failed", str(entry["trouble"])) if entry["trouble"] else ("missing", "")
    if report is not None and report.state in ("failed", "lost"):
        return "failed", report.reason
    if result and result["status"] in FINAL:
        return "done", ""
    failure = read_json(folder / FAILURE)  # of the last attempt, which may have had a result before
    if failure is not None:
        return "failed", str(failure.get("reason"))
    if result and result["status"] != OUTAGE:
        return "stopped", str(result["status"])
    return ("stopped", "interrupted") if begun else ("missing", "")


def write_rows(rows: Sequence[Row], folder: Path) -> list[str]:
    """Write ``cells.csv`` and ``cells.parquet``. Gives what could not be written, and what would make it so."""
    write_csv(folder / "cells.csv", rows)
    if importlib.util.find_spec("pyarrow") is None:
        return ['cells.parquet needs pyarrow, which is not installed: pip install "battery-sim-agent[cluster]"']
    import pyarrow
    from pyarrow import parquet

    with replacing(folder / "cells.parquet") as file:
        parquet.write_table(pyarrow.Table.from_pylist(list(rows), schema=_schema(pyarrow)), file)
    return []


def read_table(path: Path) -> list[Row]:
    """Rows of a CSV file: numbers as floats, an empty field as NaN, anything else as text."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{key: _number_or_text(value) for key, value in row.items()} for row in csv.DictReader(file)]


def _number_or_text(text: str) -> float | str:
    try:
        return float(text or "nan")
    except ValueError:
        return text


def _schema(pyarrow: Any) -> Any:
    """Types by column: a column without a value would otherwise have none."""
    types = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    return pyarrow.schema([(column.name, types[column.kind]) for column in COLUMNS])
