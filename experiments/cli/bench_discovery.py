"""``bsa bench discovery``: blind cases, made, run and graded apart."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import completion
from . import shared_options as shared
from .campaign import Executors, finish
from .option_groups import with_options
from .several_files import RecordsCommand

if TYPE_CHECKING:
    from ..campaign.summary import Row
    from ..discovery_bench.blind_cell import Kind

discovery_app = typer.Typer(
    help="Blind cases for discovery: make, run and grade them; or rank the effects without fitting them.",
    no_args_is_help=True,
)

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the blind cases.")]
Only = Annotated[
    list[str] | None, shared.records_option(metavar="CASE", help="Case to run, case_07; repeat; left out, all.")
]
Parameters = Annotated[
    str,
    shared.model_option(
        metavar="NAME|FILE|RUN",
        help="Parameters to start from; best a run that fitted this cell.",
        autocompletion=completion.parameter_sets,
    ),
]
DISCOVERY = "discovery"
"""Name of the results where none is given."""

Results = Annotated[str, shared.output_option(metavar="NAME", help="Name of the results in the folder, under grids.")]


@discovery_app.command("make")
def make_command(
    folder: Folder,
    count: Annotated[
        int, shared.records_option(min=1, metavar="N", help="How many cases to make, the seed's first.")
    ] = 200,
    seed: shared.Seed = 2026,
    short: Annotated[
        bool,
        shared.records_option("--short", help="Every effect in turn, alone, in SPMe and one or two short records."),
    ] = False,
) -> None:
    """Make blind cases, with their answers sealed."""
    from ..discovery_bench.draws import draw, draw_short
    from ..discovery_bench.making import make_cases
    from ..discovery_bench.simulated_case import make

    make_cases(folder, partial(make, drawn=draw_short if short else draw), count, seed, print)


@discovery_app.command("hide", cls=RecordsCommand)
@with_options(shared.Reading)
def hide_command(
    folder: Folder,
    data: Annotated[list[Path], shared.records_option("--data", metavar="FILE...", help="Records of one cell.")],
    parameters: Parameters,
    holdout: shared.Holdout = None,
    reference: shared.Reference = None,
    *,
    reading: shared.Reading,
    model: shared.Model = "DFN",
    search: Annotated[
        str | None,
        shared.model_option(
            metavar="NAME", help="What is uncertain, as in bsa discover.", autocompletion=completion.uncertain_presets
        ),
    ] = None,
    count: Annotated[
        int, shared.records_option(min=1, metavar="N", help="How many cases to make, the seed's first.")
    ] = 20,
    seed: shared.Seed = 2026,
) -> None:
    """Hide effects in measured records: blind cases of a real cell, with their answers sealed."""
    from ..discovery_bench.making import make_cases
    from ..discovery_bench.measured_case import hidden_in
    from ..discovery_case import RecordFile, reading_of_references, usual_search
    from ..read_options import one_each
    from ..tasks.parameter_source import names_a_set

    reads, files = reading.readings(), (*data, *(holdout or ()))
    records = [read.record(file) for read, file in zip(one_each(reads, len(files)), files, strict=True)]
    if not names_a_set(parameters) and Path(parameters).exists():
        parameters = str(Path(parameters).absolute())  # the cases are run from anywhere
    earlier = [
        RecordFile(path=path.absolute(), **reading_of_references(reads).written).model_dump(mode="json")
        for path in reference or ()
    ]
    search = search or usual_search(parameters, earlier)
    base: dict[str, Any] = {"parameters": parameters, "model": model, "search": search}
    if earlier:
        base["reference"] = earlier
    make_cases(folder, hidden_in(records[: len(data)], records[len(data) :], base), count, seed, print)


@discovery_app.command("repeats", cls=RecordsCommand)
@with_options(shared.Reading)
def repeats_command(
    data: Annotated[
        list[Path],
        shared.records_option(
            "--data", metavar="FILE...", help="Records of one test of one cell, in the order of their dates."
        ),
    ],
    parameters: Parameters,
    *,
    reading: shared.Reading,
    model: shared.Model = "DFN",
    out: Annotated[Path, shared.output_option(metavar="FILE", help="Rows, one for each record.")] = Path("repeats.csv"),
) -> None:
    """How well the tests of a cell repeat, which tells what a discovery beside references could see."""
    from ...core.files import write_csv
    from ...core.validation import validated
    from ..discovery_bench.repeats import repeats, repeats_table
    from ..discovery_case import DiscoverOptions, usual_search
    from ..read_options import one_each

    reads = one_each(reading.readings(), len(data))
    files = [{"path": path, **read.written} for path, read in zip(data, reads, strict=True)]
    search = usual_search(parameters, files)
    asked = {"data": files, "parameters": parameters, "model": model, "search": search, "out": out.parent}
    rows = repeats(validated(DiscoverOptions, asked, "discovery"))
    print(repeats_table(rows))
    write_csv(out, rows)


@discovery_app.command("run")
@with_options(Executors, workers=2)
@with_options(shared.LanguageModel)
def run_command(
    folder: Folder,
    only: Only = None,
    *,
    execution: Executors,
    model: shared.LanguageModel,
    hide_names: Annotated[
        bool, shared.language_model_option("--hide-names", help="Show the model effects under names without meaning.")
    ] = False,
    results: Results = DISCOVERY,
) -> None:
    """Run the cases that have no result yet; a language model, if one is named, ranks effects too."""
    asked = {"backend": model.backend, "backend_options": model.options(), "hide_names": hide_names}
    finish(_run(folder, results, "discovery", execution, only, asked))


def _run(
    folder: Path, name: str, kind: Kind, execution: Executors, only: list[str] | None, asked: dict[str, Any]
) -> list[Row]:
    """The rows of the cases that were to be run."""
    from ..discovery_bench.blind_cell import plan_cases

    execution.check()
    return execution.run(plan_cases(folder, name, kind, only or None, **asked))


@discovery_app.command("score")
def score_command(folder: Folder, results: Results = DISCOVERY) -> None:
    """Open the answers and grade the results."""
    from ...core.files import write_csv
    from ..discovery_bench.grading import grade_cases, graded_row
    from ..discovery_bench.tables import as_markdown, case_table

    graded = grade_cases(folder, results)
    print(as_markdown(graded))
    print(case_table(graded))
    write_csv(_table(folder, "cases", results), [graded_row(case) for case in graded])


@discovery_app.command("sensitivity")
def sensitivity_command(folder: Folder, results: Results = DISCOVERY) -> None:
    """Open the answers and decide each case again with half and twice each decision constant, from the journals."""
    from ...core.files import write_csv
    from ..discovery_bench.sensitivity import sensitivity_rows, sensitivity_table

    rows = []
    for row in sensitivity_rows(folder, results):
        if row["factor"] == 1.0:
            print(f"{row['task']}: {row['verdict']} {row['named']}".rstrip(), flush=True)
        rows.append(row)
    print(sensitivity_table(rows))
    write_csv(_table(folder, "sensitivity", results), rows)


def _table(folder: Path, what: str, results: str) -> Path:
    """``cases.csv`` of the results that have no name of their own, ``cases-NAME.csv`` of others."""
    name = Path(results).name
    return folder / (f"{what}.csv" if name == DISCOVERY else f"{what}-{name}.csv")


@discovery_app.command("shortlist")
@with_options(Executors, workers=2)
@with_options(shared.LanguageModel)
def shortlist_command(folder: Folder, only: Only = None, *, execution: Executors, model: shared.LanguageModel) -> None:
    """Rank the effects of each case, by score and by the backend; fit none of them. Keeps what was ranked, too."""
    from ...core.files import write_csv
    from ..discovery_bench.reports import write_reports
    from ..discovery_bench.shortlists import SHORTLISTS, shortlist_places, shortlist_table

    asked = {"backend": model.backend, "backend_options": model.options()}
    rows = _run(folder, SHORTLISTS, "shortlist", execution, only, asked)
    places = shortlist_places(folder)
    print(shortlist_table(places))
    write_csv(folder / "shortlists.csv", places)
    write_reports(folder, folder / "reports.json")
    finish(rows)
