"""``bsa bench``: the studies of lives, of hundreds of cycles each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import shared_options as shared
from .campaign import RESULTS, Executors, StoreOption
from .option_groups import with_options

lives_app = typer.Typer()

Only = Annotated[
    list[str] | None,
    shared.records_option("--only", metavar="NAME", help="Life to run, CS2_35; repeat; left out, all."),
]


@lives_app.command("life-cost")
def life_cost_command(
    cycles: Annotated[int, shared.records_option(min=1, metavar="N", help="Cycles of the life.")] = 200,
    store: StoreOption = RESULTS,
) -> None:
    """What simulating a life costs: with cycles left out, with all, and by PyBaMM's own experiment."""
    from ..campaign.study_cell import plan_study
    from ..studies.life_cost import CASE, cost_table, measure

    plan = plan_study("life-cost", measure, {CASE: {"cycles": cycles}}, store)
    Executors(workers=1).run_study(plan, cost_table)


@lives_app.command("life-discovery")
@with_options(Executors, workers=1)
def life_discovery_command(
    data: Annotated[
        Path | None,
        shared.records_option(
            metavar="FOLDER", help="Where the records are (they are not shipped); left out, no measured life is asked."
        ),
    ] = None,
    only: Only = None,
    *,
    execution: Executors,
    store: StoreOption = RESULTS,
) -> None:
    """Which mechanism ages lives with a hidden one, and a measured life."""
    from ..campaign.study_cell import plan_study
    from ..studies.life_discovery import ask, items, mechanisms_table, modes_table

    plan = plan_study("life-discovery", ask, items(data), store, only)
    execution.run_study(plan, mechanisms_table, life_modes=modes_table)


@lives_app.command("whole-life")
@with_options(Executors, workers=2)
def whole_life_command(
    data: shared.RecordsFolder, only: Only = None, *, execution: Executors, store: StoreOption = RESULTS
) -> None:
    """Measured lives of 500 cycles, forecast from their first 200."""
    from ..campaign.study_cell import plan_study
    from ..studies.whole_life import forecast, forecast_table, items

    execution.run_study(plan_study("whole-life", forecast, items(data), store, only), forecast_table)


@lives_app.command("fade-trends")
def fade_trends_command(data: shared.RecordsFolder, store: StoreOption = RESULTS) -> None:
    """Measured lives of 500 cycles, continued by simple laws of the cycle number, without a cell."""
    from ..campaign.study_cell import plan_study
    from ..studies.fade_trends import continue_life, trends_table
    from ..studies.whole_life import items

    Executors(workers=1).run_study(plan_study("fade-trends", continue_life, items(data), store), trends_table)
