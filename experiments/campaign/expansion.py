"""From a grid file to its cells: the product of the axes, plus what is included, minus what is excluded."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

from ...core.errors import BsaError, unknown
from ...core.run.run_config import RunConfig
from ...core.scaffold import Scaffold
from ...core.yaml_text import YAML_SUFFIXES
from ..run_settings import run_config
from .calibration import Calibration, TaskLabel
from .cell import Axes, Axis
from .grid_file import BackendChoice, GridFile
from .identity import identity_of, without_placement
from .store import Store
from .task_sources import Say, gather


def expand(
    grid: GridFile, store: Store, near: Path, say: Say = lambda line: None, make: bool = True
) -> list[Calibration]:
    """The cells of a grid, task by task, so that a grid cut short has whole rows.

    Targets that are not in the store are simulated only if ``make``; without them cells have no identity. Raises
    `BsaError` if a task, scaffold, backend or setting does not exist, or the grid has not what `exclude` or
    `reference` names.
    """
    cells: dict[tuple[str, str], Calibration] = {}
    everything = list(_all(grid, store, near, say, make))
    _check_names([cell.task for cell in everything])
    _check_excluded(grid, [cell.axes for cell in everything])
    for cell in everything:
        if not any(_fits(cell.axes, condition) for condition in grid.exclude):
            # Without an identity the configuration tells cells apart.
            cells.setdefault((cell.task.key, cell.identity or cell.config.model_dump_json()), cell)
    axes = [cell.axes for cell in cells.values()]
    _check_axes(axes)
    _check_reference(grid, [own.scaffold for own in axes])
    return list(cells.values())


def _check_names(tasks: Sequence[TaskLabel]) -> None:
    """Whether each name is that of one task: tables compare methods by it."""
    digests: dict[str, str] = {}
    for task in tasks:
        if digests.setdefault(task.key, task.digest) != task.digest:
            raise BsaError(f'two different tasks of the grid are called "{task.key}".', "rename one of them.")


def _check_axes(cells: Sequence[Axes]) -> None:
    """Whether tables can tell the cells apart: what has the same axes would be averaged as one method."""
    for axes, count in Counter(cells).items():
        if count > 1:
            raise BsaError(
                f'tables could not tell apart {count} cells of the task "{axes.task}" with the scaffold '
                f'"{axes.scaffold}", the backend "{axes.backend}" and the seed {axes.seed}.',
                "name each scaffold differently; other options or budgets of the same ones are a grid of their own.",
            )


def _check_excluded(grid: GridFile, cells: Sequence[Axes]) -> None:
    """Whether the grid has what its exclusions name; a pattern may fit nothing."""
    for condition in grid.exclude:
        for axis, value in condition.items():
            known = {str(getattr(axes, axis)) for axes in cells}
            for name in map(str, value if isinstance(value, list) else [value]):
                if name not in known and not any(sign in name for sign in "*?["):
                    message = f'exclude: the grid "{grid.name}" has no {axis} "{name}".'
                    raise unknown(message, name, sorted(known), "it has {}.")


def _check_reference(grid: GridFile, scaffolds: Sequence[str]) -> None:
    if scaffolds and grid.reference and grid.reference not in scaffolds:
        message = f'reference: the grid "{grid.name}" has no scaffold "{grid.reference}".'
        raise unknown(message, grid.reference, sorted(set(scaffolds)), "it has {}.")


def _all(grid: GridFile, store: Store, near: Path, say: Say, make: bool) -> Iterator[Calibration]:
    own = gather(grid.tasks, store, near, say, make)
    yield from _product(own, grid, near)
    for more in grid.include:
        replaced = {name: value for name in _REPLACED if (value := getattr(more, name)) is not None}
        settings = {**grid.settings, **more.settings}
        tasks = own if more.tasks is None else gather(more.tasks, store, near, say, make)
        yield from _product(tasks, grid.model_copy(update={**replaced, "settings": settings}), near)


_REPLACED = ("rounds", "warm_up", "simulations", "scaffolds", "backends", "seeds")
"""What more cells may have in place of what the grid has."""


def _product(tasks: Sequence[TaskLabel], grid: GridFile, near: Path) -> Iterator[Calibration]:
    # Configurations that differ in their seed alone are checked once.
    known: dict[str, list[tuple[BackendChoice, RunConfig]]] = {}
    for task in tasks:
        if task.simulator not in known:
            pairs = product(grid.scaffolds, grid.backends)
            known[task.simulator] = [(b, _config(grid, near, scaffold, b, task.simulator)) for scaffold, b in pairs]
        for (backend, checked), seed in product(known[task.simulator], grid.seeds):
            config = checked.model_copy(update={"seed": seed})
            identity = identity_of(config, task.digest, task.effects) if task.digest else ""
            yield Calibration(task, backend, config, identity)


def _config(grid: GridFile, near: Path, scaffold: str | Scaffold, backend: BackendChoice, simulator: str) -> RunConfig:
    if isinstance(scaffold, str):
        beside = near / scaffold
        scaffold = str(beside) if beside.suffix in YAML_SUFFIXES and beside.is_file() else scaffold
    limits = grid.model_dump(include={"rounds", "warm_up", "simulations"}, exclude_none=True)
    # What is compared gets its whole budget: nobody is stopped for want of progress.
    patience = max(limits.get("rounds", RunConfig.model_fields["rounds"].default), 1)
    settings = {**limits, "patience": patience, **grid.settings}
    return run_config(scaffold, backend.use, without_placement(backend.options), settings, simulator)


def _fits(axes: Axes, condition: Mapping[Axis, Any]) -> bool:
    wanted = {axis: value if isinstance(value, list) else [value] for axis, value in condition.items()}
    return bool(wanted) and all(
        any(fnmatchcase(str(getattr(axes, axis)), str(pattern)) for pattern in patterns)
        for axis, patterns in wanted.items()
    )
