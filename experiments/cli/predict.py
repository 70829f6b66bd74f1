"""``bsa predict``: score records that a finished run never saw."""

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ...core.printable import one_line
from . import shared_options as shared
from .option_groups import with_options


@with_options(shared.Reading)
def predict(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run.")],
    data: Annotated[
        list[Path],
        shared.records_option("--data", metavar="FILE...", help="Records, or impedance spectra, to predict."),
    ],
    *,
    reading: shared.Reading,
    initial_soc: shared.InitialSocs = None,
    workers: shared.SimulationWorkers = 0,
    band: Annotated[
        bool,
        shared.output_option(
            "--band/--no-band", help="Simulate what the fitted parameters leave open, too: a simulation for each draw."
        ),
    ] = True,
    out: Annotated[
        Path | None,
        shared.output_option(metavar="FOLDER", help="New or empty folder; default: RUN/predictions/<record>-<n>."),
    ] = None,
    as_json: Annotated[bool, shared.output_option("--json", help="Print prediction.json to standard output.")] = False,
) -> None:
    """Score records that a run did not fit, with a 95 % band of what its parameters leave open and of its misfit."""
    from ..checked_options import simulation_workers
    from ..predict import predicted
    from ..report.records import error_rows
    from ..task_request import Records
    from .progress import PlainProgress, note_line

    records = Records(data, (), reading.readings(), initial_soc or ())
    scored, page = predicted(run, records, out, simulation_workers(workers), PlainProgress(""), band)
    if as_json:
        print(json.dumps(scored.to_json(), indent=2))
        return
    for note in scored.notes:
        print(note_line(note), file=sys.stderr)
    if scored.run.analysis is None and len(scored.run.trials) > 1:
        find_out = f"to find out: bsa-run --resume {shlex.quote(str(run))}"
        print(f"note: no 95 % band: the run has not looked for what its record fixes; {find_out}", file=sys.stderr)
    for row in error_rows(scored.run.task, scored.run.records, scored.run.held_out):
        print(f"  {one_line(row.line, 600)}")
    print(f"  report: {page}")
