"""What a campaign on blind cases has found, case by case."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ...core.errors import BsaError
from ..campaign.results import grid_folder, read_manifest, rows_of
from ..campaign.store import Store
from .making import unseal


def read_results(folder: Path, name: str) -> Iterator[tuple[str, Path, Mapping[str, Any], Mapping[str, Any]]]:
    """Every case that was run, with the folder of its journal, what was found and its answer.

    Nothing was found of a case that failed. The answers of the blind cases are opened. Raises `BsaError` if there was
    no such campaign, or it is of cases that the folder has not.
    """
    store, answers = Store(folder), unseal(folder)
    for row in rows_of(read_manifest(grid_folder(name, store)), store):
        task, identity = row["task"], row["identity"]
        if task not in answers:
            raise BsaError(f"the results in {folder} are of a case that it has not: {task!r}.", "make the cases anew.")
        if row["state"] in ("done", "failed"):
            yield task, store.cell(identity), store.result(identity) or {}, answers[task]
