"""A task by the name or path that a person gives."""

from collections.abc import Iterator
from pathlib import Path

from ...core.contracts.border import border
from ...core.contracts.products import instance
from ...core.contracts.registry import OWN, Unusable, installed
from ...core.errors import BsaError, did_you_mean, unknown
from ...core.task import Task
from ...core.yaml_text import read_yaml
from .task_file import is_task_file, load_task_file

PACKAGED = Path(__file__).with_name("packaged")


def packaged_tasks() -> Iterator[tuple[str, str]]:
    """Name and summary of every task that comes with the package."""
    for path in sorted(PACKAGED.glob("*.yaml")):
        yield path.stem, str(read_yaml(path).get("summary", ""))


def task_summaries() -> dict[str, tuple[str, str]]:
    """Summary and origin of every task that can be named, by name; the origin of a packaged one is empty."""
    offered = {item.entry.name: (item.entry.summary, item.origin) for item in installed().listings("task")}
    return offered | {name: (summary, "") for name, summary in packaged_tasks()}


def packaged(name: str) -> bool:
    """Whether a task of this name is our own, be it a packaged one or a case of the published suite."""
    return _published_name(name) or any(name == known for known, _ in packaged_tasks())


def unusable_tasks() -> list[Unusable]:
    """Tasks of plugins whose name is that of one of ours, which is the one that is then found."""
    return [
        Unusable(item.entry.name, f"the name is taken by {OWN}", item.origin, "task")
        for item in installed().listings("task")
        if packaged(item.entry.name)
    ]


def find_task(name_or_path: str) -> Task:
    """A packaged task, a case of the published suite (``regular-134``), a plugin's task, or a task file.

    Raises `BsaError` if there is no such task, with the nearest name.
    """
    path = Path(name_or_path)
    if is_task_file(path):
        return load_task_file(path)
    if _published_name(name_or_path):
        return _published(name_or_path)
    if packaged(name_or_path):
        return load_task_file(PACKAGED / f"{name_or_path}.yaml")
    names = list(task_summaries())
    if name_or_path in names or any(item.kind == "task" and item.name == name_or_path for item in installed().unusable):
        return _offered(name_or_path)
    listed = "known: {}; or give a .yaml or .json task file, or --data with a record."
    raise unknown(f'there is no task "{name_or_path}".', name_or_path, names, listed)


def _offered(name: str) -> Task:
    """A plugin's task."""
    listing, task = installed().find("task", name), installed().make("task", name, {})
    with border(listing.who, "its factory"):
        return instance(task, Task)


def _published_name(name: str) -> bool:
    mode, _, number = name.partition("-")
    return number.isdigit() and mode in ("regular", "extreme", "sei")


def _published(name: str) -> Task:
    from ..suite.build import build_task
    from ..suite.published import published_cases

    cases = published_cases()
    if name not in cases:
        raise BsaError(f'the published suite has no case "{name}".', did_you_mean(name, cases))
    return build_task(cases[name])
