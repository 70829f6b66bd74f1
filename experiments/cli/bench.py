"""``bsa bench``: the studies, one command each, resumable and seeded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import completion
from . import shared_options as shared
from .bench_discovery import discovery_app
from .grid import RESULTS, Metric, StoreOption

if TYPE_CHECKING:
    from ..suite.case import SuiteCase


def _study_folder(out: Path) -> Path:
    from ..studies.cell import check_study_folder

    check_study_folder(out)
    return out


bench_app = typer.Typer(help="Run the studies: one command each, seeded, resumable.", no_args_is_help=True)

Suite = Annotated[
    str, typer.Option(metavar="NAME", help="published, generated or random.", rich_help_panel=shared.RECORDS)
]
Cases = Annotated[
    str | None,
    typer.Option(
        metavar="N|NAMES",
        help='How many cases, or which: "10", "regular-134", "extreme-*".',
        rich_help_panel=shared.RECORDS,
    ),
]
NoiseMv = Annotated[
    float,
    typer.Option(min=0.0, metavar="MV", help="Noise put on the targets' voltage.", rich_help_panel=shared.RECORDS),
]
Published = Annotated[
    Path | None,
    typer.Option(
        envvar="BSA_PUBLISHED_SUITE",
        metavar="FOLDER",
        help="Where the published task files are (they are not shipped).",
        rich_help_panel=shared.RECORDS,
    ),
]
Scaffolds = Annotated[
    str, typer.Option(metavar="NAMES", help="Scaffolds, joined by commas.", rich_help_panel=shared.SEARCH)
]
Simulations = Annotated[
    int, typer.Option(min=1, metavar="N", help="Simulations a run at most.", rich_help_panel=shared.SEARCH)
]
Backend = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="As bsa run takes it.",
        autocompletion=completion.backends,
        rich_help_panel=shared.LANGUAGE_MODEL,
    ),
]
Out = Annotated[
    Path,
    typer.Option(
        metavar="FOLDER",
        help="For tables, figures and finished cells.",
        callback=_study_folder,
        rich_help_panel=shared.OUTPUT,
    ),
]


def _chosen(
    suite: str, cases: str | None, seed: int, published: Path | None = None, noise_mv: float = 0.0
) -> list[SuiteCase]:
    from ..suite.case import Noise
    from ..suite.selection import choose, load_suite

    noise = Noise(voltage_v=noise_mv / 1e3) if noise_mv else None
    if suite == "random" and cases is not None and cases.isdigit() and int(cases):
        # Its cases are drawn one by one, and each draw simulates: no more of them than are wanted.
        return list(load_suite(suite, seed=seed, count=int(cases), noise=noise).values())
    return list(choose(load_suite(suite, published, seed=seed, noise=noise), cases).values())


@bench_app.command("suite")
def suite_command(
    suite: Suite = "published",
    cases: Cases = None,
    scaffolds: Scaffolds = "default,least-squares,hybrid",
    simulations: Simulations = 100,
    workers: shared.Workers = 2,
    seed: shared.Seed = 1234,
    backend: Backend = "rules",
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    published: Published = None,
    noise_mv: NoiseMv = 0.0,
    own_budget: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=N",
            help="Simulations of one base cell's cases, ORegan2022=50; repeat.",
            rich_help_panel=shared.SEARCH,
        ),
    ] = None,
    out: Out = Path("results/suite"),
) -> None:
    """The paper's main table: errors by mode and chemistry, with the paper's rows beside."""
    from ..studies.suite import suite_study

    suite_study(
        _chosen(suite, cases, seed, published, noise_mv),
        out,
        scaffolds.split(","),
        simulations,
        workers,
        seed,
        backend,
        shared.reaching(via, base_url, backend_option),
        own_budgets=_own_budgets(own_budget),
    )
    print(f"{out / 'table.md'}")


def _own_budgets(pairs: list[str] | None) -> dict[str, int]:
    from ...core.errors import BsaError
    from ..request import key_values

    budgets = key_values(pairs, "--own-budget")
    for name, count in budgets.items():
        if type(count) is not int or count < 1:
            raise BsaError(f"--own-budget {name}={count}: not a number of simulations.", "write ORegan2022=50.")
    return budgets


@bench_app.command("runtime")
def runtime_command(
    case: Annotated[
        str, typer.Option(metavar="NAME", help="The case to time.", rich_help_panel=shared.RECORDS)
    ] = "regular-60",
    suite: Suite = "generated",
    scaffolds: Scaffolds = "full,hybrid,cma-es",
    steps: Annotated[
        int, typer.Option(min=10, metavar="N", help="Steps of the outer loop.", rich_help_panel=shared.SEARCH)
    ] = 20,
    seed: shared.Seed = 1234,
    backend: Backend = "rules",
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    published: Published = None,
    out: Out = Path("results/runtime"),
) -> None:
    """Matched steps: simulator, model and proposer time, first five against last five."""
    from ..studies.runtime import runtime_study

    (chosen, *_) = _chosen(suite, case if not case.isdigit() else f"regular-{case}", seed, published)
    reached = shared.reaching(via, base_url, backend_option)
    runtime_study(chosen, out, scaffolds.split(","), steps, seed, backend, reached)
    print(f"{out / 'runtime.md'}")


@bench_app.command("recovery")
def recovery_command(
    suite: Suite = "published",
    cases: Cases = "10",
    scaffolds: Scaffolds = "full,hybrid",
    simulations: Simulations = 100,
    workers: shared.Workers = 2,
    seed: shared.Seed = 1234,
    backend: Backend = "rules",
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    published: Published = None,
    noise_mv: NoiseMv = 0.0,
    out: Out = Path("results/recovery"),
) -> None:
    """Whether a better fit means better parameters, and what held-out rates say."""
    from ..studies.recovery import recovery_study

    recovery_study(
        _chosen(suite, cases, seed, published, noise_mv),
        out,
        scaffolds.split(","),
        simulations,
        workers,
        seed,
        backend,
        shared.reaching(via, base_url, backend_option),
    )
    print(f"{out}")


@bench_app.command("warmup")
def warmup_command(
    suite: Suite = "published",
    cases: Cases = "10",
    scaffold: Annotated[
        str,
        typer.Option(metavar="NAME", help="Scaffold whose warm-up is exchanged.", rich_help_panel=shared.SEARCH),
    ] = "full",
    simulations: Simulations = 100,
    workers: shared.Workers = 2,
    seed: shared.Seed = 1234,
    backend: Backend = "rules",
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    published: Published = None,
    noise_mv: NoiseMv = 0.0,
    out: Out = Path("results/warmup"),
) -> None:
    """Random against proposed perturbations."""
    from ..studies.warmup import warmup_study

    warmup_study(
        _chosen(suite, cases, seed, published, noise_mv),
        out,
        scaffold,
        simulations=simulations,
        workers=workers,
        seed=seed,
        backend=backend,
        backend_options=shared.reaching(via, base_url, backend_option),
    )
    print(f"{out / 'warmup.md'}")


@bench_app.command("no-harm")
def no_harm_command(
    suite: Suite = "published",
    cases: Cases = "20",
    simulations: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Simulations of least squares at most; hybrid gets a quarter more.",
            rich_help_panel=shared.SEARCH,
        ),
    ] = 100,
    workers: shared.Workers = 2,
    seed: shared.Seed = 1234,
    published: Published = None,
    out: Out = Path("results/no-harm"),
) -> None:
    """Hybrid with random, hostile and reasoned advice, against least squares with a fifth fewer simulations."""
    from ..studies.no_harm import no_harm_study

    no_harm_study(_chosen(suite, cases, seed, published), out, simulations, workers, seed)
    print(f"{out / 'no_harm.md'}")


@bench_app.command("evaluation")
def evaluation_command(
    task: Annotated[
        str, typer.Argument(metavar="TASK", help="Task to evaluate.", autocompletion=completion.tasks)
    ] = "demo",
    repeats: Annotated[
        int, typer.Option(min=3, metavar="N", help="Evaluations a median is over.", rich_help_panel=shared.SEARCH)
    ] = 15,
    out: Out = Path("results/evaluation"),
) -> None:
    """What one evaluation costs against PyBaMM by itself, and what the loop adds to a round."""
    from dataclasses import asdict

    from ..studies.evaluation import measure_evaluation
    from ..studies.table import write_csv

    cost = measure_evaluation(task, repeats)
    write_csv(out / "evaluation.csv", [asdict(cost)])
    print("\n".join(cost.lines()))


@bench_app.command("docs")
def docs_command(
    root: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="A checkout of this package, with its README.md and docs.")
    ] = Path(),
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Change nothing; exit code 1 where a table is not what its rows say.",
            rich_help_panel=shared.OUTPUT,
        ),
    ] = False,
) -> None:
    """Rebuild every table of README.md and docs/*.md from the rows in docs/results."""
    from ..doc_tables.rebuild import rebuild

    changed = rebuild(root, write=not check)
    for path in changed:
        print(f"{path} {'differs from its rows' if check else 'written'}")
    if check and changed:
        raise typer.Exit(1)


@bench_app.command("tables")
def tables_command(
    grid: Annotated[str, typer.Argument(metavar="GRID", help="A grid that was run, by name, file or folder.")],
    store: StoreOption = RESULTS,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Where to write; default: the grid's folder.", rich_help_panel=shared.OUTPUT
        ),
    ] = None,
    metric: Metric = "mape",
) -> None:
    """Tables of a grid in the paper's form (Markdown, LaTeX), figures (SVG) and paired statistics."""
    from ..grid.tables import tables

    for path in tables(grid, store, out, metric):
        print(path)


bench_app.add_typer(discovery_app, name="discovery")
