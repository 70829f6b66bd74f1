"""``bsa grid`` and ``bsa report``: many runs as one file, and what came of them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import completion
from . import shared_options as shared

if TYPE_CHECKING:
    from ..grid.pool import Pool
    from ..grid.results import Row
    from ..grid.running import Plan, WatcherContext

StoreOption = Annotated[
    Path,
    typer.Option(
        metavar="FOLDER", help="Holds cells and grids; grids share cells in it.", rich_help_panel=shared.OUTPUT
    ),
]
Metric = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Error that is compared and drawn: mape, rmse or v_rmse_mv.",
        rich_help_panel=shared.OUTPUT,
    ),
]

RESULTS = Path("results")


def grid(
    file: Annotated[
        str,
        typer.Argument(
            metavar="GRID",
            help="A shipped grid (rules-ablation, main-table, ...) or a YAML file.",
            autocompletion=completion.grids,
        ),
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Any key of the grid: rounds=5, seeds=[1,2], tasks.0.cases=2; repeat.",
            rich_help_panel=shared.SEARCH,
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Say what would be run and what it would take; run nothing.",
            rich_help_panel=shared.SEARCH,
        ),
    ] = False,
    workers: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Cells side by side; 0: as many as cores.", rich_help_panel=shared.SEARCH
        ),
    ] = 0,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="PLACE",
            help="Dask: tcp://HOST:PORT of a scheduler, or slurm:FILE.yaml (dask-jobqueue).",
            rich_help_panel=shared.SEARCH,
        ),
    ] = None,
    memory_limit: Annotated[
        float,
        typer.Option(
            min=1,
            metavar="MB",
            help="Replace a local worker that grows past this.",
            rich_help_panel=shared.SEARCH,
        ),
    ] = 1500,
    max_tokens: Annotated[
        int | None,
        typer.Option(
            min=0, metavar="N", help="Begin no cell after so many tokens.", rich_help_panel=shared.LANGUAGE_MODEL
        ),
    ] = None,
    max_cost: Annotated[
        float | None,
        typer.Option(
            min=0, metavar="USD", help="Begin no cell after so much money.", rich_help_panel=shared.LANGUAGE_MODEL
        ),
    ] = None,
    store: StoreOption = RESULTS,
) -> None:
    """Run a grid: tasks x scaffolds x backends x seeds. What is finished is not run again."""
    from ..grid.execution import Allowance
    from ..grid.running import plan_grid, run_grid
    from ..request import key_values

    if cluster is not None:
        from ..grid.dask_pool import check_cluster

        check_cluster(cluster)
    plan = plan_grid(file, store, key_values(settings, "--set"), _say, make=not dry_run)
    if dry_run:
        _print_estimate(plan, workers or os.cpu_count() or 1)
        return
    rows, remarks = run_grid(plan, _pool(cluster, workers, memory_limit), _watcher, Allowance(max_tokens, max_cost))
    for remark in remarks:
        _say(remark)
    _print_outcome(plan, rows)
    if any(row["state"] != "done" for row in rows):
        raise typer.Exit(1)


def report(
    grid: Annotated[
        str,
        typer.Argument(metavar="GRID", help="A grid that was run, by name, file or folder; or a run's folder."),
    ],
    store: StoreOption = RESULTS,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The page; default: in the folder of the grid or run.", rich_help_panel=shared.OUTPUT
        ),
    ] = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Write the full report of every finished run first.", rich_help_panel=shared.OUTPUT
        ),
    ] = False,
    metric: Metric = "mape",
) -> None:
    """Write one page on a grid: tables, figures, comparisons, and the rounds of every run."""
    if (Path(grid) / "journal.jsonl").is_file():
        from ..report import build_report

        print(build_report(Path(grid), out))
        return
    from ..grid.page import build_page

    print(build_page(grid, store, out, full, metric))


def _pool(cluster: str | None, workers: int, memory_limit_mb: float) -> Pool:
    if cluster is not None:
        from ..grid.dask_pool import DaskPool

        return DaskPool(cluster)
    from ..grid.local_pool import LocalPool

    return LocalPool(workers or os.cpu_count() or 1, memory_limit_mb=memory_limit_mb)


def _watcher(plan: Plan, pool: Pool) -> WatcherContext:
    from ..grid.progress import LiveGrid, PlainGrid

    if sys.stderr.isatty():
        return LiveGrid(plan.grid.name, plan.cells, pool.workers)
    return PlainGrid(plan.cells, pool.workers)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _print_estimate(plan: Plan, workers: int) -> None:
    from ..grid.estimate import Need, estimate
    from ..report.wording import duration

    finished = sum(bool(cell.identity and plan.store.result(cell.identity)) for cell in plan.cells)
    print(f"{plan.grid.name}: {len(plan.cells)} runs, {finished} of them finished already")
    total = Need()
    for name, need in estimate(plan.cells, plan.store).items():
        total = total + need
        print(f"  {name:40s} {_words(need)}")
    print(f"  {'to be run':40s} {_words(total)}")
    rule = "from finished cells" if total.learnt else "by rule of thumb: run a few cells, and the estimate learns"
    print(f"About {duration(total.seconds / workers)} with {workers} workers ({rule}).")


def _words(need: Any) -> str:
    cost = "price unknown" if need.cost_usd is None else f"${need.cost_usd:.2f}"
    return (
        f"{need.cells:6d} runs, {need.simulations:8d} simulations, {need.calls:7d} calls at most; "
        f"{need.tokens:10d} tokens, {cost}, {need.seconds / 3600:.2f} h of one worker"
    )


def _print_outcome(plan: Plan, rows: list[Row]) -> None:
    from ..grid.tables import blocks, compared_metric

    folder = plan.store.grid(plan.grid.name)
    for block in blocks(rows, compared_metric(rows, "mape")):
        print(f"\n{block.title}: {', '.join(block.columns)}")
        for method, values in block.rows:
            entries = ", ".join("–" if value is None else str(value) for value in values)
            print(f"  {method:32s} {entries}")
    for state in ("failed", "stopped", "missing"):
        left = [row for row in rows if row["state"] == state]
        if left:
            reason = f": {left[0]['task']}: {left[0]['reason']}" if left[0]["reason"] else ""
            print(f"{len(left)} cells {state}{reason}. The same command runs them again.", file=sys.stderr)
    print(f"\n{folder / 'cells.csv'}\nbsa report {plan.grid.name} writes the page.")
