"""A whole grid from its file to its results, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ...backends.opening import check_backend
from ...core.errors import BsaError
from ...core.registry import installed
from .execution import Allowance, Watcher, run_cells
from .expansion import GridCell, expand
from .grid_file import GridFile, grid_path, load_grid
from .one_cell import Report
from .pool import Pool
from .results import Row, check_grid_folder, read_manifest, rows_of, write_manifest, write_rows
from .store import Store
from .task_sources import Say


class WatcherContext(Watcher, AbstractContextManager["WatcherContext"], Protocol):
    """A watcher that is opened and closed around the grid."""


@dataclass(frozen=True)
class Plan:
    """A grid that is about to run.

    Attributes
    ----------
    grid : GridFile
        The file, with what replaced it.
    cells : list of GridCell
        Its cells.
    store : Store
        Where results lie.
    """

    grid: GridFile
    cells: list[GridCell]
    store: Store


def plan_grid(
    name_or_path: str,
    store: Path,
    changes: Mapping[str, Any] | None = None,
    say: Say = lambda line: None,
    make: bool = True,
) -> Plan:
    """Read a grid and expand it.

    Parameters
    ----------
    name_or_path : str
        A shipped grid, or a YAML file.
    store : Path
        Where results lie.
    changes : mapping, optional
        Values that replace the file's, by dotted path.
    say : callable
        Takes a line of progress: making targets takes seconds each.
    make : bool
        Whether targets that are not in the store are made; without them nothing can be run.

    Raises
    ------
    BsaError
        If the grid, or anything it names, does not exist.
    """
    place = Store(store)
    place.check()
    grid = load_grid(name_or_path, changes)
    check_grid_folder(place.grid(grid.name))
    cells = expand(grid, place, grid_path(name_or_path).parent, say, make)
    if not cells:
        raise BsaError(f'the grid "{grid.name}" has no cells.', "exclude less.")
    _check_plugins(cells)
    return Plan(grid, cells, place)


def _check_plugins(cells: Sequence[GridCell]) -> None:
    """Whether every plugin exists and is configured well, before the first cell is run."""
    registry = installed()
    for config in {cell.config.model_dump_json(exclude={"seed"}): cell.config for cell in cells}.values():
        scaffold = config.scaffold
        check_backend(config.backend, config.backend_options, registry)
        registry.configure("simulator", scaffold.simulator.use, scaffold.simulator.options)
        registry.configure("feedback", scaffold.feedback.use, scaffold.feedback.options)
        registry.configure("proposer", scaffold.proposer.use, scaffold.proposer.options)
        for memory in scaffold.memories:
            registry.configure("memory", memory.use, memory.options)
        if scaffold.warm_up is not None:
            registry.configure("warm-up", scaffold.warm_up.use, scaffold.warm_up.options)


def run_grid(
    plan: Plan, pool: Pool, watch: Callable[[Plan, Pool], WatcherContext], allowance: Allowance | None = None
) -> tuple[list[Row], list[str]]:
    """Run what is missing and write the tidy table, however the grid ends.

    Parameters
    ----------
    plan : Plan
        From `plan_grid`.
    pool : Pool
        Who carries out the cells; closed at the end.
    watch : callable
        Makes what watches.
    allowance : Allowance, optional
        What may be spent on language models.

    Returns
    -------
    rows : list of dict
        The tidy table.
    remarks : list of str
        What could not be written.
    """
    folder = write_manifest(plan.grid, plan.cells, plan.store)
    reports: dict[str, Report] = {}
    try:
        with watch(plan, pool) as watcher:
            reports = run_cells(plan.cells, plan.store, pool, watcher, allowance)
    finally:
        pool.close()
        rows = rows_of(read_manifest(folder), plan.store, reports)
        remarks = write_rows(rows, folder)
    return rows, remarks
