"""``bsa bench``: the studies, one command each, resumable and seeded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import completion
from . import shared_options as shared
from .bench_discovery import discovery_app
from .bench_lives import lives_app
from .campaign import RESULTS, Execution, Executors, Metric, StoreOption, finish, print_outcome, say
from .option_groups import with_options

if TYPE_CHECKING:
    from ...core.scaffold import Scaffold
    from ..campaign.grid_file import GridFile, SuiteFilter
    from ..campaign.store import Store
    from ..campaign.summary import Row

bench_app = typer.Typer(help="Run the studies: one command each, seeded, resumable.", no_args_is_help=True)

Suite = Annotated[str, shared.records_option(metavar="NAME", help="published, generated, random or lives.")]
Published = Annotated[
    Path | None,
    shared.records_option(
        envvar="BSA_PUBLISHED_SUITE",
        metavar="FOLDER",
        help="Where the published task files are (they are not shipped).",
    ),
]


@dataclass(frozen=True)
class Cases:
    """Which cases a study takes."""

    suite: Suite = "published"
    cases: Annotated[
        str | None,
        shared.records_option(metavar="N|NAMES", help='How many cases, or which: "10", "regular-134", "extreme-*".'),
    ] = None
    published: Published = None
    noise_mv: Annotated[
        float, shared.records_option(min=0.0, metavar="MV", help="Noise put on the targets' voltage.")
    ] = 0.0

    def filter(self, seed: int) -> SuiteFilter:
        """The cases; of the random suite those of a seed."""
        from ...core.validation import validated
        from ..campaign.grid_file import SuiteFilter

        return validated(
            SuiteFilter,
            {
                "suite": self.suite,
                "cases": self.cases,
                "folder": self.published,
                "noise_mv": self.noise_mv,
                "draw": seed if self.suite == "random" else 0,
            },
            "the cases",
        )


Scaffolds = Annotated[str, shared.search_option(metavar="NAMES", help="Scaffolds, joined by commas.")]
Simulations = Annotated[int, shared.search_option(min=1, metavar="N", help="Simulations a run at most.")]
Out = Annotated[
    Path | None,
    shared.output_option(metavar="FOLDER", help="For tables and figures; default: a folder of the store, grids/STUDY."),
]

Analysis = Callable[["list[Row]", "Store", Path], Any]


@dataclass(frozen=True)
class Study(shared.LanguageModel, Execution, Cases):
    """What a study of calibrations is told, whatever it compares."""

    simulations: Simulations = 100
    seed: shared.Seed = 1234
    out: Out = None

    @property
    def chosen(self) -> SuiteFilter:
        """Its cases."""
        return self.filter(self.seed)

    def grid(self, name: str, scaffolds: Sequence[str | Scaffold], **more: Any) -> GridFile:
        """Every case by every method; ``more`` as in `study_grid`."""
        from ..studies.grids import study_grid

        return study_grid(name, self.chosen, scaffolds, self.choice, self.simulations, self.seed, **more)


def _study(grid: GridFile, execution: Execution, out: Path | None, analyse: Analysis | None = None) -> None:
    """Run a study's grid, write the tables of every campaign, and then its own."""
    from ..campaign.running import plan_campaign
    from ..campaign.tables import tables

    execution.check()
    plan = plan_campaign(grid, execution.store, out, say=say, make=not execution.dry_run)
    rows = execution.run(plan)
    if any(row["state"] == "done" for row in rows):
        tables(plan.folder, execution.store)
        if analyse is not None:
            analyse(rows, plan.store, plan.folder)
    print_outcome(plan, rows)
    finish(rows)


@bench_app.command("suite")
@with_options(Study, backend="rules", workers=2)
def suite_command(
    study: Study,
    *,
    scaffolds: Scaffolds = "default,least-squares,hybrid",
    own_budget: Annotated[
        list[str] | None,
        shared.search_option(metavar="NAME=N", help="Simulations of one base cell's cases, ORegan2022=50; repeat."),
    ] = None,
) -> None:
    """The paper's main table: errors by mode and chemistry, with the paper's rows beside."""
    budgets = _own_budgets(own_budget)
    grid = study.grid("suite", scaffolds.split(","), own_budgets=budgets, paper_rows=True)
    _study(grid, study, study.out)


def _own_budgets(pairs: list[str] | None) -> dict[str, int]:
    from ...core.errors import BsaError
    from ..run_settings import key_values

    budgets = key_values(pairs, "--own-budget")
    for name, count in budgets.items():
        if type(count) is not int or count < 1:
            raise BsaError(f"--own-budget {name}={count}: not a number of simulations.", "write ORegan2022=50.")
    return budgets


@bench_app.command("runtime")
@with_options(shared.LanguageModel, backend="rules")
def runtime_command(
    *,
    case: Annotated[str, shared.records_option(metavar="NAME", help="The case to time.")] = "regular-60",
    suite: Suite = "generated",
    published: Published = None,
    scaffolds: Scaffolds = "full,hybrid,cma-es",
    steps: Annotated[int, shared.search_option(min=10, metavar="N", help="Steps of the outer loop.")] = 20,
    seed: shared.Seed = 1234,
    model: shared.LanguageModel,
    store: StoreOption = RESULTS,
    out: Out = None,
) -> None:
    """Matched steps: simulator, model and proposer time, first five against last five."""
    from ..studies.grids import study_grid
    from ..studies.runtime import write_runtime

    name = f"regular-{case}" if case.isdigit() else case
    chosen = Cases(suite, name, published).filter(seed)
    grid = study_grid("runtime", chosen, scaffolds.split(","), model.choice, steps + 1, seed)
    # One after the other: cells side by side would time each other.
    _study(grid, Execution(workers=1, store=store), out, write_runtime)


@bench_app.command("recovery")
@with_options(Study, cases="10", backend="rules", workers=2)
def recovery_command(study: Study, *, scaffolds: Scaffolds = "full,hybrid") -> None:
    """Whether a better fit means better parameters, and what held-out rates say."""
    from ..campaign.task_sources import suite_cases
    from ..studies.recovery import write_recovery

    analyse = partial(write_recovery, cases=suite_cases(study.chosen), seed=study.seed, say=say)
    _study(study.grid("recovery", scaffolds.split(",")), study, study.out, analyse)


@bench_app.command("warmup")
@with_options(Study, cases="10", backend="rules", workers=2)
def warmup_command(
    study: Study,
    *,
    scaffold: Annotated[
        str, shared.search_option(metavar="NAME", help="Scaffold whose warm-up is exchanged.")
    ] = "full",
) -> None:
    """Random against proposed perturbations."""
    from ...core.scaffold import load_scaffold
    from ..studies.warmup import STRATEGIES, with_warm_up, write_warmup

    scaffolds = [with_warm_up(load_scaffold(scaffold), strategy) for strategy in STRATEGIES]
    _study(study.grid("warmup", scaffolds), study, study.out, write_warmup)


@bench_app.command("no-harm")
@with_options(Cases, cases="20")
@with_options(Execution, workers=2)
def no_harm_command(
    cases: Cases,
    *,
    simulations: Annotated[
        int,
        shared.search_option(
            min=1, metavar="N", help="Simulations of least squares at most; hybrid gets a quarter more."
        ),
    ] = 100,
    seed: shared.Seed = 1234,
    execution: Execution,
    out: Out = None,
) -> None:
    """Hybrid with random, hostile and reasoned advice, against least squares with a fifth fewer simulations."""
    from ..studies.no_harm import no_harm_grid, write_no_harm

    _study(no_harm_grid(cases.filter(seed), simulations, seed), execution, out, write_no_harm)


@bench_app.command("evaluation")
def evaluation_command(
    task: Annotated[
        str, typer.Argument(metavar="TASK", help="Task to evaluate.", autocompletion=completion.tasks)
    ] = "demo",
    repeats: Annotated[int, shared.search_option(min=3, metavar="N", help="Evaluations a median is over.")] = 15,
    store: StoreOption = RESULTS,
) -> None:
    """What one evaluation costs against PyBaMM by itself, and what the loop adds to a round."""
    from ..campaign.study_cell import plan_study
    from ..studies.evaluation import evaluation_table, measure

    plan = plan_study("evaluation", measure, {task: {"task_name": task, "repeats": repeats}}, store)
    Executors(workers=1).run_study(plan, evaluation_table)


@bench_app.command("coverage")
@with_options(Executors, workers=2)
def coverage_command(
    *,
    tasks: Annotated[int, shared.records_option(min=1, metavar="N", help="How many tasks.")] = 100,
    model: Annotated[str, shared.records_option(metavar="NAME", help="SPM, SPMe or DFN.")] = "SPMe",
    points: Annotated[
        int, shared.records_option(min=10, metavar="N", help="Mesh points of the truth; fits have 20.")
    ] = 30,
    simulations: Simulations = 100,
    seed: shared.Seed = 1234,
    execution: Executors,
    store: StoreOption = RESULTS,
) -> None:
    """How often 95 % intervals contain the truth, on noisy synthetic tasks; the same command goes on after a stop."""
    from ..studies.coverage import coverage_table, plan_coverage

    execution.run_study(plan_coverage(store, tasks, seed, model, points, simulations), coverage_table)


@bench_app.command("real-cells")
def real_cells_command(
    data: shared.RecordsFolder,
    only: Annotated[
        list[str] | None, shared.records_option("--cell", metavar="NAME", help="Run this cell alone; repeat.")
    ] = None,
    paper: Annotated[
        bool, shared.records_option("--paper", help="First cycles with their steps simulated, judged as in the paper.")
    ] = False,
    scaffold: Annotated[str, shared.search_option(metavar="NAME|FILE", help="Scaffold.")] = "staged",
    simulations: Simulations = 100,
    seed: shared.Seed = 1234,
    workers: shared.SimulationWorkers = 0,
    out: Annotated[Path, shared.output_option(metavar="FOLDER", help="For the runs and the rows.")] = RESULTS
    / "real-cells",
) -> None:
    """Measured cells of public data sets: fitted, and scored on records that the fit never saw."""
    from ...core.files import write_csv
    from ..checked_options import simulation_workers
    from ..studies.real_cells import MEASURED_CURRENT, PAPER, chosen, line_of, run_cell, run_cells, with_earlier

    at_once = simulation_workers(workers)
    study = PAPER if paper else MEASURED_CURRENT
    rows, remarks = run_cells(
        chosen(only or [], study),
        data,
        out / study,
        lambda cell, folder: run_cell(cell, data, folder, scaffold, simulations, seed, at_once),
    )
    for row in rows:
        print(line_of(row))
    for remark in remarks:
        say(remark)
    if rows:
        table = out / f"{study}.csv"
        write_csv(table, with_earlier(rows, table, study))
    if remarks:
        raise typer.Exit(1)


@bench_app.command("models")
@with_options(Study, suite="generated", simulations=20, backend="rules", workers=1)
def models_command(
    study: Study,
    *,
    scaffold: Annotated[str, shared.search_option(metavar="NAME", help="Scaffold of the calibrations.")] = "full",
    warmup: Annotated[
        int | None, shared.search_option(min=0, metavar="N", help="Warm-up simulations; default: a fifth of all.")
    ] = None,
    reports: Annotated[
        Path | None,
        shared.records_option(metavar="FILE", help="Discrepancy reports to be ranked in place of the packaged ones."),
    ] = None,
    rankings: Annotated[
        bool, shared.records_option("--rankings/--no-rankings", help="Whether reports are ranked at all.")
    ] = True,
) -> None:
    """A card of a language model: twelve calibrations, and discrepancy reports ranked with names and without."""
    from dataclasses import replace

    from ..campaign.running import plan_campaign
    from ..discovery_bench.reports import PACKAGED, read_reports
    from ..studies.models import CASES, card, models_grid, plan_rankings, write_card

    backend = study.choice
    chosen = replace(study, cases=study.cases or ",".join(CASES)).chosen
    told = read_reports(reports or PACKAGED) if rankings else []
    study.check()
    grid = models_grid(chosen, backend, scaffold, study.simulations, study.seed, warmup)
    plan = plan_campaign(grid, study.store, study.out, say=say, make=not study.dry_run)
    rows = study.run(plan)
    ranked: list[Row] = []
    if told:
        ranked = study.run(plan_rankings(told, backend, study.seed, study.store, plan.folder / "rankings"))
    found = card(backend.use, scaffold, study.simulations, rows, ranked, told, plan.store)
    print(write_card(found, plan.folder))
    finish([*rows, *ranked])


@bench_app.command("tables")
def tables_command(
    grid: Annotated[str, typer.Argument(metavar="GRID", help="A grid that was run, by name, file or folder.")],
    store: StoreOption = RESULTS,
    out: Annotated[
        Path | None, shared.output_option(metavar="FOLDER", help="Where to write; default: the grid's folder.")
    ] = None,
    metric: Metric = "mape",
) -> None:
    """Tables of a grid or study in the paper's form (Markdown, LaTeX), figures (SVG) and paired statistics."""
    from ..campaign.tables import tables

    for path in tables(grid, store, out, metric):
        print(path)


bench_app.add_typer(lives_app)
bench_app.add_typer(discovery_app, name="discovery")
