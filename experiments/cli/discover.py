"""``bsa discover``: find where a model and records disagree, and name the missing effect."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...core.errors import BsaError
from ...core.printable import one_line
from . import completion
from . import shared_options as shared
from .exit_codes import STOPPED
from .option_groups import with_options
from .resumable import resumable

if TYPE_CHECKING:
    from ..discovery_case import DiscoverOptions


@with_options(shared.Reading)
@with_options(shared.LanguageModel)
def discover(
    context: typer.Context,
    *,
    data: Annotated[
        list[Path] | None, shared.records_option("--data", metavar="FILE...", help="Records to explain.")
    ] = None,
    holdout: shared.Holdout = None,
    reference: shared.Reference = None,
    join: shared.Join = False,
    reading: shared.Reading,
    initial_soc: shared.InitialSocs = None,
    life: shared.Life = False,
    fit_cycles: shared.FitCycles = None,
    parameters: Annotated[
        str | None,
        shared.model_option(
            metavar="NAME|FILE|RUN",
            help="Parameters to start from: a PyBaMM set, a BPX or JSON file, or an earlier run.",
            autocompletion=completion.parameter_sets,
        ),
    ] = None,
    model: shared.Model = "DFN",
    options: shared.ModelOptions = None,
    override: Annotated[
        list[str] | None, shared.model_option(metavar="NAME=VALUE", help="A parameter that is known better; repeat.")
    ] = None,
    search: Annotated[
        str | None,
        shared.model_option(
            metavar="NAME|FILE",
            help="What is uncertain about the base model: all, capacity, particles, measured, unchanged, or a YAML "
            "file; left out, unchanged with --reference, measured from a run, else all.",
            autocompletion=completion.uncertain_presets,
        ),
    ] = None,
    scale: shared.Scale = True,
    effect: Annotated[
        list[str] | None,
        shared.search_option(
            metavar="NAME", help="Effect to consider; repeat; left out, all.", autocompletion=completion.effects
        ),
    ] = None,
    effect_option: Annotated[
        list[str] | None,
        shared.search_option(
            "--effect-option", metavar="KEY=VALUE", help="Option of an effect, effect.key=value or key=value; repeat."
        ),
    ] = None,
    max_effects: Annotated[
        int, shared.search_option(min=1, max=2, metavar="N", help="Effects in one explanation at most.")
    ] = 2,
    seed: shared.Seed = 0,
    workers: shared.SimulationWorkers = 0,
    language_model: shared.LanguageModel,
    out: Annotated[
        Path | None,
        shared.output_option(metavar="FOLDER", help="Folder of the discovery; default: runs/<record>-discover-<n>."),
    ] = None,
    resume: shared.Resume = None,
    as_json: Annotated[bool, shared.output_option("--json", help="Print discovery.json to standard output.")] = False,
) -> None:
    """Find where a model and measured records disagree, name the missing effect, add it, show the gap shrink.

    A language model, if one is named, ranks effects too.
    """
    from ..discovery_case import discover_options
    from ..run_settings import key_values
    from ..task_request import Records

    if resume is not None:
        from ..discovery_journal import read_options

        shared.note_what_resuming_leaves(context, ("workers", "as_json"))
        _carry_out(read_options(resume), workers, as_json)
        return
    if not data or parameters is None:
        missing = "--data" if not data else "--parameters"
        raise BsaError(f"{missing} is missing.", "bsa discover --data RECORD.csv --parameters Chen2020, for example.")
    asked = discover_options(
        Records(
            data,
            holdout or (),
            reading.readings(join),
            initial_soc or (),
            life=life,
            fit_cycles=fit_cycles,
        ),
        out,
        parameters=parameters,
        model=model,
        options=key_values(options, "--options"),
        overrides=key_values(override, "--override"),
        scale=scale,
        search=search,
        effects=effect,
        effect_options=key_values(effect_option, "--effect-option"),
        backend=language_model.backend,
        backend_options=language_model.options(),
        reference=reference or (),
        max_effects=max_effects,
        seed=seed,
    )
    _carry_out(asked, workers, as_json)


def _carry_out(asked: DiscoverOptions, workers: int, as_json: bool) -> None:
    from ...core.messages import Outage
    from ..checked_options import simulation_workers
    from ..discover import discover as find
    from ..report.discovery_lines import found_lines
    from ..report.page import FILE_NAME as REPORT

    go_on = f"bsa discover --resume {shlex.quote(str(asked.out))}"
    try:
        with resumable(asked.out, go_on):
            found = find(asked, _Said(f"discovery → {asked.out}"), simulation_workers(workers))
    except (KeyboardInterrupt, Outage) as stopped:
        why = "interrupted" if isinstance(stopped, KeyboardInterrupt) else one_line(str(stopped), 400)
        print(f"Stopped: {why}. Go on with: {go_on}", file=sys.stderr)
        raise typer.Exit(STOPPED["interrupted" if isinstance(stopped, KeyboardInterrupt) else "outage"]) from None
    if as_json:
        print(json.dumps(found.to_json(), indent=1, allow_nan=False))
        return
    print(f"verdict: {found.verdict}")
    print(f"  {found.headline}")
    for line in found_lines(found):
        print(f"  {one_line(line, 300)}")
    print(f"  {one_line(found.findings.reason, 1500)}")
    print(f"  report: {asked.out / REPORT}")


class _Said:
    """Prints what is being done, below a title: with the first line the options are known to be right."""

    def __init__(self, title: str) -> None:
        self._title = title

    def __call__(self, text: str) -> None:
        title, self._title = self._title, ""
        for line in (title, text) if title else (text,):
            print(one_line(line, 1500), file=sys.stderr, flush=True)
