"""``bsa bench``: the studies, one command each, resumable and seeded."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import shared_options as shared

if TYPE_CHECKING:
    from ..suite.case import SuiteCase


def _study_folder(out: Path) -> Path:
    from ..studies.cell import check_study_folder

    check_study_folder(out)
    return out


bench_app = typer.Typer(help="Run the studies: one command each, seeded, resumable.", no_args_is_help=True)

Suite = Annotated[str, typer.Option(help="published, generated or random.")]
Cases = Annotated[str | None, typer.Option(help='How many cases, or which: "10", "regular-134", "extreme-*".')]
Scaffolds = Annotated[str, typer.Option(help="Scaffolds, joined by commas.")]
Simulations = Annotated[int, typer.Option(min=1, help="Simulations a run at most.")]
Workers = Annotated[int, typer.Option(min=1, help="Runs side by side.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed for everything random.")]
Backend = Annotated[str, typer.Option(help="Language model, as bsa run takes it.")]
Out = Annotated[Path, typer.Option(help="Folder for tables, figures and finished cells.", callback=_study_folder)]
NoiseMv = Annotated[float, typer.Option(min=0.0, help="Measurement noise put on the targets' voltage, mV.")]
Published = Annotated[
    Path | None,
    typer.Option(envvar="BSA_PUBLISHED_SUITE", help="Folder of the published task files (they are not shipped)."),
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
    workers: Workers = 2,
    seed: Seed = 1234,
    backend: Backend = "rules",
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    published: Published = None,
    noise_mv: NoiseMv = 0.0,
    own_budget: Annotated[
        list[str] | None, typer.Option(help="Simulations of one base cell's cases, ORegan2022=50; repeat.")
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
    case: Annotated[str, typer.Option(help="The case to time.")] = "regular-60",
    suite: Suite = "generated",
    scaffolds: Scaffolds = "full,hybrid,cma-es",
    steps: Annotated[int, typer.Option(min=10, help="Steps of the outer loop.")] = 20,
    seed: Seed = 1234,
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
    workers: Workers = 2,
    seed: Seed = 1234,
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
    scaffold: Annotated[str, typer.Option(help="Scaffold whose warm-up is exchanged.")] = "full",
    simulations: Simulations = 100,
    workers: Workers = 2,
    seed: Seed = 1234,
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
        int, typer.Option(min=1, help="Simulations of least squares at most; hybrid gets a quarter more.")
    ] = 100,
    workers: Workers = 2,
    seed: Seed = 1234,
    published: Published = None,
    out: Out = Path("results/no-harm"),
) -> None:
    """Hybrid with random, hostile and reasoned advice, against least squares with a fifth fewer simulations."""
    from ..studies.no_harm import no_harm_study

    no_harm_study(_chosen(suite, cases, seed, published), out, simulations, workers, seed)
    print(f"{out / 'no_harm.md'}")


@bench_app.command("evaluation")
def evaluation_command(
    task: Annotated[str, typer.Argument(help="Task to evaluate.")] = "demo",
    repeats: Annotated[int, typer.Option(min=3, help="Evaluations a median is over.")] = 15,
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
    root: Annotated[Path, typer.Argument(help="A checkout of this package, with its README.md and docs.")] = Path(),
    check: Annotated[
        bool, typer.Option(help="Change nothing; exit code 1 where a table is not what its rows say.")
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
    grid: Annotated[str, typer.Argument(help="A grid that was run, by name, file or folder.")],
    store: Annotated[Path, typer.Option(help="Folder that the grid was run in.")] = Path("results"),
    out: Annotated[Path | None, typer.Option(help="Where to write; default: the grid's folder.")] = None,
    metric: Annotated[str, typer.Option(help="Error that is compared and drawn: mape, rmse or v_rmse_mv.")] = "mape",
) -> None:
    """Tables of a grid in the paper's form (Markdown, LaTeX), figures (SVG) and paired statistics."""
    from ..grid.tables import tables

    for path in tables(grid, store, out, metric):
        print(path)


@bench_app.command("discovery")
def discovery_command(
    make: Annotated[Path | None, typer.Option(help="Make the blind cases in this folder, answers sealed.")] = None,
    run: Annotated[Path | None, typer.Option(help="Run the cases of this folder that have no result yet.")] = None,
    score: Annotated[Path | None, typer.Option(help="Open the answers of this folder and mark the results.")] = None,
    shortlist: Annotated[
        Path | None,
        typer.Option(help="Rank the effects of this folder's cases, by score and by the backend; fit none of them."),
    ] = None,
    count: Annotated[int | None, typer.Option(min=1, help="How many cases to make; left out, all.")] = None,
    workers: Workers = 2,
    seed: Seed = 2026,
    backend: Annotated[str | None, typer.Option(help="Language model that ranks effects too.")] = None,
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    hide_names: Annotated[bool, typer.Option(help="Show the model effects under names without meaning.")] = False,
    only: Annotated[list[str] | None, typer.Option(help="Case to run, case_07; repeat; left out, all.")] = None,
    results: Annotated[str, typer.Option(help="File in the folder that results go to and are read from.")] = (
        "results.jsonl"
    ),
) -> None:
    """Blind cases for discovery: make them, run them, mark them; or ask who finds the hidden effect without a fit."""
    from ..discovery_bench.making import make_cases
    from ..discovery_bench.running import run_case, run_cases
    from ..discovery_bench.scoring import as_markdown, case_table, mark_cases, marked_row
    from ..discovery_bench.shortlists import SHORTLISTS, shortlist_case, shortlist_places, shortlist_table
    from ..studies.table import write_csv

    if make is None and run is None and score is None and shortlist is None:
        from ...core.errors import BsaError

        raise BsaError("nothing was asked for.", "give --make, --run, --score or --shortlist DIR, or several of them.")
    if make is not None:
        make_cases(make, count, seed, print)
    model: dict[str, Any] = {
        "backend": backend,
        "backend_options": shared.reaching(via, base_url, backend_option),
    }
    if run is not None:
        work = partial(run_case, **model, hide_names=hide_names)
        run_cases(run, work, workers, only, results, print)
    if score is not None:
        marked = mark_cases(score, results)
        print(as_markdown(marked))
        print(case_table(marked))
        write_csv(score / "cases.csv", [marked_row(case) for case in marked])
    if shortlist is not None:
        run_cases(shortlist, partial(shortlist_case, **model), workers, only, SHORTLISTS, print)
        places = shortlist_places(shortlist)
        print(shortlist_table(places))
        write_csv(shortlist / "shortlists.csv", places)
