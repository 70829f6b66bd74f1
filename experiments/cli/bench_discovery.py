"""``bsa bench discovery``: blind cases, made, run and graded apart."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from . import completion
from . import shared_options as shared

discovery_app = typer.Typer(
    help="Blind cases for discovery: make, run and grade them; or rank the effects without fitting them.",
    no_args_is_help=True,
)

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the blind cases.")]
Only = Annotated[
    list[str] | None,
    typer.Option(metavar="CASE", help="Case to run, case_07; repeat; left out, all.", rich_help_panel=shared.RECORDS),
]
Results = Annotated[
    str, typer.Option(metavar="NAME", help="File in the folder with the results.", rich_help_panel=shared.OUTPUT)
]
Backend = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Language model that ranks effects too.",
        autocompletion=completion.backends,
        rich_help_panel=shared.LANGUAGE_MODEL,
    ),
]

RESULTS = "results.jsonl"


@discovery_app.command("make")
def make_command(
    folder: Folder,
    count: Annotated[
        int,
        typer.Option(
            min=1, metavar="N", help="How many cases to make, the seed's first.", rich_help_panel=shared.RECORDS
        ),
    ] = 200,
    seed: shared.Seed = 2026,
) -> None:
    """Make blind cases, with their answers sealed."""
    from ..discovery_bench.making import make_cases

    make_cases(folder, count, seed, print)


@discovery_app.command("run")
def run_command(
    folder: Folder,
    only: Only = None,
    workers: shared.Workers = 2,
    backend: Backend = None,
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
    hide_names: Annotated[
        bool,
        typer.Option(
            "--hide-names",
            help="Show the model effects under names without meaning.",
            rich_help_panel=shared.LANGUAGE_MODEL,
        ),
    ] = False,
    results: Results = RESULTS,
) -> None:
    """Run the cases that have no result yet."""
    from ..discovery_bench.running import run_case, run_cases

    reached = shared.reaching(via, base_url, backend_option)
    work = partial(run_case, backend=backend, backend_options=reached, hide_names=hide_names)
    run_cases(folder, work, workers, only, results, print)


@discovery_app.command("score")
def score_command(folder: Folder, results: Results = RESULTS) -> None:
    """Open the answers and grade the results."""
    from ...core.files import write_csv
    from ..discovery_bench.grading import grade_cases, graded_row
    from ..discovery_bench.tables import as_markdown, case_table

    graded = grade_cases(folder, results)
    print(as_markdown(graded))
    print(case_table(graded))
    write_csv(folder / "cases.csv", [graded_row(case) for case in graded])


@discovery_app.command("shortlist")
def shortlist_command(
    folder: Folder,
    only: Only = None,
    workers: shared.Workers = 2,
    backend: Backend = None,
    via: shared.Via = None,
    base_url: shared.BaseUrl = None,
    backend_option: shared.BackendOption = None,
) -> None:
    """Rank the effects of each case, by score and by the backend; fit none of them."""
    from ...core.files import write_csv
    from ..discovery_bench.running import run_cases
    from ..discovery_bench.shortlists import SHORTLISTS, shortlist_case, shortlist_places, shortlist_table

    reached = shared.reaching(via, base_url, backend_option)
    work = partial(shortlist_case, backend=backend, backend_options=reached)
    run_cases(folder, work, workers, only, SHORTLISTS, print)
    places = shortlist_places(folder)
    print(shortlist_table(places))
    write_csv(folder / "shortlists.csv", places)
