"""A cell that is one item of a study: a function of plain values, whose answer is its result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.files import write_json
from .cell import Axis
from .identity import versions_of
from .results import check_grid_folder
from .running import Plan
from .store import RESULT, Store


@dataclass(frozen=True)
class StudyCell:
    """One item of a study; see `Cell`."""

    # study, item: Names of both.
    study: str
    item: str
    # Given what was asked as keywords, answers with plain values: a ``summary`` in words, and what the study needs.
    act: Callable[..., Mapping[str, Any]]
    asked: Mapping[str, Any]  # Plain values.
    identity: str  # Hash of all that and the code.
    trouble: str = ""  # Empty: an item can be carried out.

    @property
    def axes(self) -> dict[Axis, str]:
        """What tables group by."""
        return {
            "task": self.item,
            "mode": self.study,
            "chemistry": "",
            "rates": "",
            "scaffold": self.study,
            "backend": "none",
            "seed": str(self.asked.get("seed", 0)),
        }

    def run(self, folder: Path, store: Store) -> dict[str, Any]:
        """See `Cell.run`."""
        content = {"status": "finished", "best": {}, "initial": {}, **self.act(**self.asked)}
        write_json(folder / RESULT, content)
        return content


def plan_study(
    study: str, act: Callable[..., Mapping[str, Any]], items: Mapping[str, Mapping[str, Any]], store: Path
) -> Plan[StudyCell]:
    """Every item of a study as a cell.

    Parameters
    ----------
    act : callable
        At the top level of a module, so that worker processes find it; see `StudyCell`.
    items : mapping of str to mapping
        What is asked of each item, by its name.

    Raises
    ------
    BsaError
        If the store or the study's folder holds something else.
    """
    place = Store(store)
    place.check()
    folder = place.grid(study)
    check_grid_folder(folder)
    return Plan({"name": study}, [_cell(study, item, act, asked) for item, asked in items.items()], place, folder)


def _cell(study: str, item: str, act: Callable[..., Mapping[str, Any]], asked: Mapping[str, Any]) -> StudyCell:
    determining = {"study": study, "asked": dict(asked), "versions": versions_of(())}
    identity = hashlib.sha256(json.dumps(determining, sort_keys=True).encode()).hexdigest()[:16]
    return StudyCell(study, item, act, asked, identity)


def results_of(plan: Plan[StudyCell]) -> list[dict[str, Any]]:
    """The results of the items that are done, in the order of the plan."""
    found = (plan.store.result(cell.identity) for cell in plan.cells)
    return [result for result in found if result is not None]
