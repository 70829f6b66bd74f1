"""``bsa grid`` and ``bsa report``: many runs as one file, and what came of them; how every campaign is carried out."""

from __future__ import annotations

import os
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...core.errors import BsaError
from ...core.printable import counted, one_line, shown
from . import completion
from . import shared_options as shared
from .exit_codes import INTERRUPTED
from .option_groups import with_options

if TYPE_CHECKING:
    from ...core.run.allowance import Allowance
    from ..campaign.execution import Pool
    from ..campaign.progress import LiveCampaign, PlainCampaign
    from ..campaign.running import Plan
    from ..campaign.study_cell import StudyCell, Table
    from ..campaign.summary import Row

StoreOption = Annotated[
    Path, shared.output_option(metavar="FOLDER", help="Holds cells and grids; grids share cells in it.")
]
Metric = Annotated[
    str, shared.output_option(metavar="NAME", help="Error that is compared and drawn: mape, rmse or v_rmse_mv.")
]

RESULTS = Path("results")
_METRIC = "mape"


@dataclass(frozen=True)
class Executors:
    """Who carries out a campaign."""

    workers: Annotated[
        int, shared.search_option(min=0, metavar="N", help="Cells side by side; 0: as many as cores.")
    ] = 0
    cluster: Annotated[
        str | None,
        shared.search_option(
            metavar="PLACE", help="Dask: tcp://HOST:PORT of a scheduler, or slurm:FILE.yaml (dask-jobqueue)."
        ),
    ] = None
    memory_limit: Annotated[
        float, shared.search_option(min=1, metavar="MB", help="Replace a local worker that grows past this.")
    ] = 1500
    dry_run: Annotated[
        bool, shared.search_option("--dry-run", help="Say what would be run and what it would take; run nothing.")
    ] = False

    def check(self) -> None:
        """Refuse what names no cluster, before anything is made for it."""
        if self.cluster is not None:
            from ..campaign.dask_pool import check_cluster

            check_cluster(self.cluster)

    def run(self, plan: Plan[Any]) -> list[Row]:
        """Run what is missing of a campaign; with ``--dry-run`` say what it would take, and end.

        Gives the results table of what was to be run; `finish` says what is missing in it.
        """
        from ..campaign.running import run_campaign

        if self.dry_run:
            _print_estimate(plan, self.workers or os.cpu_count() or 1)
            raise typer.Exit
        try:
            rows, remarks = run_campaign(plan, self._pool(), _watcher(plan), self._allowance)
        except KeyboardInterrupt:
            say("Stopped: interrupted. The same command goes on where it was; what is finished is kept.")
            raise typer.Exit(INTERRUPTED) from None
        for remark in remarks:
            say(remark)
        return [row for row in rows if plan.only is None or row["task"] in plan.only]

    def run_study(self, plan: Plan[StudyCell], table: Table, **parts: Table) -> None:
        """Run what is missing of a study, and write and print what its items have found; see `write_found`.

        ``parts`` are the tables of other parts of their results than the ``rows``.
        """
        from ..campaign.study_cell import write_found

        self.check()
        rows = self.run(plan)
        texts = [write_found(plan, of_part, part) for part, of_part in {"rows": table, **parts}.items()]
        print("\n\n".join(filter(None, texts)))
        finish(rows)

    @property
    def _allowance(self) -> Allowance:
        """What may be spent."""
        from ...core.run.allowance import UNLIMITED

        return UNLIMITED

    def _pool(self) -> Pool:
        if self.cluster is not None:
            from ..campaign.dask_pool import DaskPool

            return DaskPool(self.cluster)
        from ..campaign.local_pool import LocalPool

        return LocalPool(self.workers or os.cpu_count() or 1, memory_limit_mb=self.memory_limit)


@dataclass(frozen=True)
class Execution(Executors):
    """How a campaign of calibrations is carried out, and what may be spent."""

    max_tokens: Annotated[
        int | None, shared.language_model_option(min=0, metavar="N", help="Begin no cell after so many tokens.")
    ] = None
    max_cost: Annotated[
        float | None, shared.language_model_option(min=0, metavar="USD", help="Begin no cell after so much money.")
    ] = None
    store: StoreOption = RESULTS

    @property
    def _allowance(self) -> Allowance:
        from ...core.run.allowance import Allowance

        return Allowance(self.max_tokens, self.max_cost)


@with_options(Execution)
def grid(
    file: Annotated[
        str,
        typer.Argument(
            metavar="GRID",
            help="A shipped grid (rules-ablation, main-table, ...) or a YAML file.",
            autocompletion=completion.grids,
        ),
    ],
    *,
    settings: Annotated[
        list[str] | None,
        shared.search_option(
            "--set", metavar="KEY=VALUE", help="Any key of the grid: rounds=5, seeds=[1,2], tasks.0.cases=2; repeat."
        ),
    ] = None,
    execution: Execution,
) -> None:
    """Run a grid: tasks x scaffolds x backends x seeds. What is finished is not run again."""
    from ..campaign.running import plan_grid
    from ..run_settings import key_values

    execution.check()
    plan = plan_grid(file, execution.store, key_values(settings, "--set"), say, make=not execution.dry_run)
    rows = execution.run(plan)
    print_outcome(plan, rows)
    finish(rows)


def report(
    grid: Annotated[
        str, typer.Argument(metavar="GRID", help="A grid that was run, by name, file or folder; or a run's folder.")
    ],
    store: StoreOption = RESULTS,
    out: Annotated[
        Path | None, shared.output_option(metavar="FILE", help="The page; default: in the folder of the grid or run.")
    ] = None,
    full: Annotated[
        bool, shared.output_option("--full", help="Write the full report of every finished run first.")
    ] = False,
    metric: Metric = _METRIC,
) -> None:
    """Write one page on a grid or study: tables, figures, comparisons, and the rounds of every run."""
    if (Path(grid) / "journal.jsonl").is_file():
        from ..report.page import build_report

        given = {"--store": store != RESULTS, "--full": full, "--metric": metric != _METRIC}
        _check_of_run(grid, [name for name, is_given in given.items() if is_given])
        print(build_report(Path(grid), out))
        return
    from ..campaign.page import build_page

    print(build_page(grid, store, out, full, metric))


def _check_of_run(run: str, given: list[str]) -> None:
    """Refuse options of a grid where the folder of a run was named."""
    if given:
        verb = "goes" if len(given) == 1 else "go"
        raise BsaError(
            f"{', '.join(given)} {verb} with a grid, but {shown(run, 200)} is the folder of a run.",
            "leave that out; the report of a run has all of its errors.",
        )


def _watcher(plan: Plan[Any]) -> LiveCampaign | PlainCampaign:
    from ..campaign.progress import LiveCampaign, PlainCampaign

    if sys.stderr.isatty():
        return LiveCampaign(plan.name, plan.chosen)
    return PlainCampaign(plan.chosen)


def say(line: str) -> None:
    """Print a line of progress."""
    print(line, file=sys.stderr, flush=True)


def _print_estimate(plan: Plan[Any], workers: int) -> None:
    from ..campaign.calibration import Calibration
    from ..campaign.estimate import Need, estimate
    from ..report.wording import duration

    left = [cell for cell in plan.chosen if not (cell.identity and plan.store.result(cell.identity))]
    print(f"{plan.name}: {counted(len(plan.chosen), 'run')}, {len(plan.chosen) - len(left)} of them finished already")
    calibrations = [cell for cell in plan.chosen if isinstance(cell, Calibration)]
    if not calibrations:  # An item of a study has no budget by which its time could be told.
        for cell in left:
            print("  " + one_line(": ".join(filter(None, (cell.axes.task, cell.trouble))), 400))
        return
    total = Need()
    for name, need in estimate(calibrations, plan.store).items():
        total = total + need
        print(f"  {one_line(name):40s} {_words(need)}")
    print(f"  {'to be run':40s} {_words(total)}")
    rule = "from finished cells" if total.learnt else "by rule of thumb: run a few cells, and the estimate learns"
    print(f"About {duration(total.seconds / workers)} with {counted(workers, 'worker')} ({rule}).")


def _words(need: Any) -> str:
    cost = "price unknown" if need.cost_usd is None else f"${need.cost_usd:.2f}"
    return (
        f"{need.cells:6d} runs, {need.simulations:8d} simulations at most; about {need.calls:7d} calls, "
        f"{need.tokens:10d} tokens, {cost}, {need.seconds / 3600:.2f} h of one worker"
    )


def print_outcome(plan: Plan[Any], rows: list[Row]) -> None:
    """Print the errors by method, and where the table lies."""
    from ..campaign.tables import blocks, compared_metric

    for block in blocks(rows, compared_metric(rows, "mape")):
        print("\n" + one_line(f"{block.title}: {', '.join(block.columns)}", 400))
        for method, values in block.rows.items():
            entries = ", ".join("–" if value is None else str(value) for value in values)
            print(f"  {one_line(method):32s} {entries}")
    where = plan.name if plan.folder == plan.store.grid(plan.name) else plan.folder
    elsewhere = [] if plan.store.root == RESULTS else ["--store", str(plan.store.root)]
    page = shlex.join(["bsa", "report", str(where), *elsewhere])
    print(f"\n{plan.folder / 'cells.csv'}\n{page} writes the page.")


def finish(rows: list[Row]) -> None:
    """Say which cells have no result; exit code 1 where there are any.

    Raises `BsaError` if no cell could be begun: no item of the study has its file.
    """
    if rows and all(row["state"] == "failed" and not row["identity"] for row in rows):
        raise BsaError(one_line(rows[0]["reason"], 400), "check the path that the study reads.")
    for state in ("failed", "stopped", "missing"):
        left = [row for row in rows if row["state"] == state]
        if left:
            why = one_line(f"{left[0]['task']}: {left[0]['reason']}", 400)
            reason = f": {why}" if left[0]["reason"] else ""
            them = "it" if len(left) == 1 else "them"
            again = f"goes on with {them}" if state == "stopped" else f"runs {them} again"
            end = "" if reason.endswith(".") else "."
            # A cell whose task could not be made has no identity: first its cause is to be resolved.
            what_next = f" The same command {again}." if any(row["identity"] for row in left) else ""
            say(f"{counted(len(left), 'cell')} {state}{reason}{end}{what_next}")
    if any(row["state"] != "done" for row in rows):
        raise typer.Exit(1)
