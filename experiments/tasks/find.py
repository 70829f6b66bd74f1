"""A task by the name or path that a person gives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...core.errors import BsaError, did_you_mean
from ...core.task import Task
from ...core.yaml_text import read_yaml
from .task_file import load_task_file

PACKAGED = Path(__file__).with_name("packaged")


def packaged_tasks() -> Iterator[tuple[str, str]]:
    """Name and summary of every task that comes with the package."""
    for path in sorted(PACKAGED.glob("*.yaml")):
        yield path.stem, str(read_yaml(path).get("summary", ""))


def find_task(name_or_path: str) -> Task:
    """A packaged task, a case of the published suite (``regular-134``), or a task file.

    Raises
    ------
    BsaError
        If there is no such task, with the nearest name.
    """
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        return load_task_file(path)
    names = [name for name, _ in packaged_tasks()]
    if name_or_path in names:
        return load_task_file(PACKAGED / f"{name_or_path}.yaml")
    mode, _, number = name_or_path.partition("-")
    if number.isdigit() and mode in ("regular", "extreme", "sei"):
        return _published(name_or_path)
    raise BsaError(
        f'there is no task "{name_or_path}".',
        did_you_mean(name_or_path, names)
        or f"packaged: {', '.join(names)}; or give a .yaml task file, or --data with a record.",
    )


def _published(name: str) -> Task:
    from ..suite.build import build_task
    from ..suite.published import published_cases

    cases = published_cases()
    if name not in cases:
        raise BsaError(f'the published suite has no case "{name}".', did_you_mean(name, cases))
    return build_task(cases[name])
