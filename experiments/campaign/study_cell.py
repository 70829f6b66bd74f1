"""A cell that is one item of a study: a function of plain values, whose answer is its result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.files import write_json
from ...core.run.run_config import hash_of
from .cell import Axes
from .identity import versions_of_study
from .results import check_grid_folder
from .running import Plan
from .store import RESULT, Store


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
    study: str, act: Callable[..., Mapping[str, Any]], items: Mapping[str, Mapping[str, Any]], store: Path
) -> Plan[StudyCell]:
    """Every item of a study as a cell.

    ``act`` stands at the top level of a module, so that worker processes find it (see `StudyCell`); ``items`` says what
    is asked of each item, by its name. Raises `BsaError` if the store or the study's folder holds something else.
    """
    place = Store(store)
    place.check()
    folder = place.grid(study)
    check_grid_folder(folder)
    return Plan({"name": study}, [_cell(study, item, act, asked) for item, asked in items.items()], place, folder)


def _cell(study: str, item: str, act: Callable[..., Mapping[str, Any]], asked: Mapping[str, Any]) -> StudyCell:
    determining = {"study": study, "asked": dict(asked), "versions": versions_of_study()}
    axes = Axes(task=item, mode=study, scaffold=study, seed=asked.get("seed", 0))
    return StudyCell(axes, act, asked, hash_of(determining))


def results_of(plan: Plan[StudyCell]) -> list[dict[str, Any]]:
    """The results of the items that are done, in the order of the plan."""
    found = (plan.store.result(cell.identity) for cell in plan.cells)
    return [result for result in found if result is not None]
