"""A whole campaign from its description to its results."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from ...backends.opening import check_backend
from ...core.contracts.registry import installed
from ...core.errors import BsaError
from ...core.run.allowance import UNLIMITED, Allowance
from .calibration import Calibration
from .cell import Cell, Report
from .execution import Pool, Watcher, run_cells
from .expansion import expand
from .grid_file import GridFile, grid_path, load_grid
from .results import check_grid_folder, rows_of, write_manifest, write_rows
from .store import Store
from .summary import Row
from .task_sources import Say

Kind = TypeVar("Kind", bound=Cell, covariant=True)


@dataclass(frozen=True)
class Plan(Generic[Kind]):
    """A campaign that is about to run."""

    # Its ``name``, and what else its manifest is to tell: a grid's file, with what replaced it.
    about: Mapping[str, Any]
    cells: Sequence[Kind]
    store: Store  # Where results lie.
    folder: Path  # For its manifest and tables.
    only: Sequence[str] | None = None  # Tasks that are run this time; all by default.

    @property
    def chosen(self) -> list[Kind]:
        """The cells that are run this time."""
        return [cell for cell in self.cells if self.only is None or cell.axes.task in self.only]

    @property
    def name(self) -> str:
        """The campaign's name."""
        return str(self.about["name"])


def plan_grid(
    name_or_path: str,
    store: Path,
    changes: Mapping[str, Any] | None = None,
    say: Say = lambda line: None,
    make: bool = True,
) -> Plan[Calibration]:
    """Read a grid and expand it.

    ``changes`` replace values of a shipped grid or of a YAML file by dotted path; all else as in `plan_campaign`.
    Raises `BsaError` if the grid, or anything it names, does not exist.
    """
    Store(store).check()
    grid = load_grid(name_or_path, changes)
    return plan_campaign(grid, store, near=grid_path(name_or_path).parent, say=say, make=make)


def plan_campaign(
    grid: GridFile,
    store: Path,
    out: Path | None = None,
    near: Path = Path(),
    say: Say = lambda line: None,
    make: bool = True,
) -> Plan[Calibration]:
    """Expand a grid.

    Manifest and tables go to ``out``, by default a folder of the store with the grid's name. Task and scaffold files
    are looked for in ``near`` first. ``say`` is told of each target that is made, which takes seconds; without ``make``
    none is, and nothing can be run. Raises `BsaError` if anything that the grid names does not exist, or a folder holds
    something else.
    """
    place = Store(store)
    place.check()
    folder = out or place.grid(grid.name)
    check_grid_folder(folder)
    cells = expand(grid, place, near, say, make)
    if not cells:
        raise BsaError(f'the grid "{grid.name}" has no cells.', "exclude less.")
    _check_plugins(cells)
    return Plan(grid.model_dump(mode="json"), cells, place, folder)


def _check_plugins(cells: Sequence[Calibration]) -> None:
    """Whether every plugin exists and is configured well, before the first cell is run."""
    registry = installed()
    for backend in {cell.backend.model_dump_json(): cell.backend for cell in cells}.values():
        # With its address and the like, which are no part of a configuration.
        check_backend(backend.use, backend.options, registry)
    for config in {cell.config.model_dump_json(exclude={"seed"}): cell.config for cell in cells}.values():
        for kind, choice in config.scaffold.parts:
            registry.configure(kind, choice.use, choice.options)


def run_campaign(
    plan: Plan[Cell],
    pool: Pool,
    watching: AbstractContextManager[Watcher],
    allowance: Allowance = UNLIMITED,
) -> tuple[list[Row], list[str]]:
    """Run what is missing and write the tidy table, however the campaign ends.

    The pool is closed at the end. Gives the tidy table of this plan, also where another process has begun a campaign
    in the same folder meanwhile, and what could not be written.
    """
    manifest = write_manifest(plan.about, plan.cells, plan.folder)
    reports: dict[str, Report] = {}
    try:
        with watching as watcher:
            reports = run_cells(plan.chosen, plan.store, pool, watcher, allowance)
    finally:
        pool.close()
        rows = rows_of(manifest, plan.store, reports)
        remarks = write_rows(rows, plan.folder)
    return rows, remarks
