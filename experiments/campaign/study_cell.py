"""A cell that is one item of a study: a function of plain values, whose answer is its result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.errors import unknown
from ...core.files import file_digest, write_csv, write_json, write_text
from ...core.run.run_config import hash_of
from .cell import Axes
from .identity import versions_of_study
from .results import check_grid_folder
from .running import Plan
from .store import RESULT, Store
from .summary import Row

Table = Callable[[Sequence[Row]], str]
"""Makes a Markdown table of rows, of which there is one at least."""


@dataclass(frozen=True)
class StudyCell:
    """One item of a study; see `Cell`."""

    axes: Axes
    # Given the cell's folder and what was asked as keywords, answers with plain values: a ``summary`` in words, and
    # what the study needs.
    act: Callable[..., Mapping[str, Any]]
    asked: Mapping[str, Any]
    identity: str  # Hash of all that and the code.
    trouble: str = ""  # Empty: an item can be carried out.

    def run(self, folder: Path, store: Store) -> dict[str, Any]:
        """See `Cell.run`."""
        content = {"status": "finished", "best": {}, "initial": {}, **self.act(folder, **self.asked)}
        write_json(folder / RESULT, content)
        return content


def plan_study(
    study: str,
    act: Callable[..., Mapping[str, Any]],
    items: Mapping[str, Mapping[str, Any]],
    store: Path,
    only: Sequence[str] | None = None,
) -> Plan[StudyCell]:
    """Every item of a study as a cell.

    ``act`` stands at the top level of a module, so that worker processes find it (see `StudyCell`); ``items`` says what
    is asked of each item, by its name. A path that is asked is that of a file, whose content determines the result.
    ``only`` are the items that are run this time, all by default. Raises `BsaError` if there is no such item, or the
    store or the study's folder holds something else.
    """
    for name in only or ():
        if name not in items:
            raise unknown(f'the study {study} has no item "{name}".', name, items, "items: {}.")
    place = Store(store)
    place.check()
    folder = place.grid(study)
    check_grid_folder(folder)
    cells = [_cell(study, item, act, asked) for item, asked in items.items()]
    return Plan({"name": study}, cells, place, folder, only or None)


def _cell(study: str, item: str, act: Callable[..., Mapping[str, Any]], asked: Mapping[str, Any]) -> StudyCell:
    axes = Axes(task=item, mode=study, scaffold=study, seed=asked.get("seed", 0))
    missing = [value for value in asked.values() if isinstance(value, Path) and not value.is_file()]
    if missing:
        return StudyCell(axes, act, asked, "", f"there is no file {missing[0]}.")
    told = {name: file_digest(value) if isinstance(value, Path) else value for name, value in asked.items()}
    return StudyCell(axes, act, asked, hash_of({"study": study, "asked": told, "versions": versions_of_study()}))


def rows_found(plan: Plan[StudyCell], part: str = "rows") -> list[Row]:
    """The rows that one part of the results holds, of the items that are done, in the order of the plan."""
    found = (plan.store.result(cell.identity) for cell in plan.cells if cell.identity)
    return [row for result in found if result is not None for row in result[part]]


def write_found(plan: Plan[StudyCell], table: Table, part: str = "rows") -> str:
    """Write what the items that are done have found, and give its table; nothing where none is done.

    ``STUDY.csv`` has the rows, ``STUDY.md`` the table; those of another part than the ``rows`` are named after it.
    """
    rows = rows_found(plan, part)
    if not rows:
        return ""
    path = plan.folder / (plan.name.replace("-", "_") if part == "rows" else part)
    text = table(rows)
    write_csv(path.with_suffix(".csv"), rows)
    write_text(path.with_suffix(".md"), text + "\n")
    return text
