"""What a campaign on blind cases has found, case by case."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ...core.errors import BsaError
from ..campaign.results import grid_folder, read_manifest, rows_of
from ..campaign.store import Store
from .making import unseal


def read_results(folder: Path, name: str) -> Iterator[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    """Every case that was run, with what was found and its answer; nothing was found of a case that failed.

    The answers of the blind cases are opened. Raises `BsaError` if there was no such campaign, or it is of cases that
    the folder has not.
    """
    store = Store(folder)
    for task, identity, answer in _cases(folder, name, ("done", "failed")):
        yield task, store.result(identity) or {}, answer


def finished_cases(folder: Path, name: str) -> Iterator[tuple[str, Path, Mapping[str, Any]]]:
    """Every case that has a result, with the folder of its journal and its answer; see `read_results`."""
    for task, identity, answer in _cases(folder, name, ("done",)):
        yield task, Store(folder).cell(identity), answer


def _cases(folder: Path, name: str, states: tuple[str, ...]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    store, answers = Store(folder), unseal(folder)
    for row in rows_of(read_manifest(grid_folder(name, store)), store):
        if row["task"] not in answers:
            raise BsaError(
                f"the results in {folder} are of a case that it has not: {row['task']!r}.", "make the cases anew."
            )
        if row["state"] in states:
            yield row["task"], row["identity"], answers[row["task"]]
