"""``bsa run``, also ``bsa-run``: calibrate a task or a record."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...core.errors import BsaError
from ...core.printable import counted, one_line
from ...core.run.journal import FILE_NAME, check_run_folder
from . import completion
from . import shared_options as shared
from .discover_command import discover_command
from .exit_codes import INTERRUPTED, STOPPED
from .option_groups import with_options
from .resumable import resumable

if TYPE_CHECKING:
    from ...core.run.loop import RunResult
    from ...core.run.run_config import RunConfig
    from ...core.task import Task
    from ..request import RunRequest


@with_options(shared.Reading)
@with_options(shared.LanguageModel, backend="rules")
def run(
    context: typer.Context,
    task: Annotated[
        str | None,
        typer.Argument(
            metavar="TASK",
            help="Task by name (bsa list tasks), task file, or case of the published suite where it is; default demo.",
            autocompletion=completion.tasks,
        ),
    ] = None,
    data: Annotated[
        list[Path] | None, shared.records_option("--data", metavar="FILE...", help="Cycler records.")
    ] = None,
    holdout: shared.Holdout = None,
    join: shared.Join = False,
    *,
    reading: shared.Reading,
    initial_soc: shared.InitialSocs = None,
    parameters: Annotated[
        str | None,
        shared.model_option(
            metavar="NAME|FILE|RUN",
            help="Parameters to start from, for --data: a PyBaMM set, nearest (of all sets, to a slow record), a "
            "BPX or JSON file, or an earlier run.",
            autocompletion=completion.parameter_sets,
        ),
    ] = None,
    start_from: Annotated[
        Path | None,
        shared.model_option(
            metavar="RUN",
            help="Begin at an earlier run's best values, with its parameters, model, options and search.",
        ),
    ] = None,
    model: Annotated[str | None, shared.model_option(metavar="NAME", help="SPM, SPMe or DFN (the default).")] = None,
    options: shared.ModelOptions = None,
    search: Annotated[
        str | None,
        shared.model_option(
            metavar="NAME|FILE",
            help="What is searched, for --data: a preset (cell, the default; life, that of --life; silicon-cell, "
            "pulsed-cell, geometry, sei, ageing) or a YAML file.",
            autocompletion=completion.search_presets,
        ),
    ] = None,
    effect: Annotated[
        list[str] | None,
        shared.model_option(
            metavar="NAME",
            help="Effect of the catalogue to add to the model, ocp-hysteresis; its parameters are searched; repeat.",
            autocompletion=completion.effects,
        ),
    ] = None,
    ocp: shared.Ocp = "",
    scale: shared.Scale = True,
    as_protocol: Annotated[
        bool,
        shared.model_option(
            "--as-protocol",
            help="Simulate the steps that the records show, in place of their measured current: charge is then judged.",
        ),
    ] = False,
    life: shared.Life = False,
    fit_cycles: shared.FitCycles = None,
    weight: Annotated[
        str | None,
        shared.model_option(
            metavar="uniform|robust",
            help="How errors count: robust keeps what is far off for a short time from deciding the fit.",
        ),
    ] = None,
    scaffold: Annotated[
        str | None,
        shared.search_option(
            metavar="NAME|FILE",
            help="Scaffold by name, or a YAML file; default staged for measured currents without a language model, "
            "else hybrid.",
            autocompletion=completion.scaffolds,
        ),
    ] = None,
    rounds: Annotated[
        int | None,
        shared.search_option(min=0, metavar="N", help="Search rounds at most; default 80, of a resumed run its own."),
    ] = None,
    warmup: Annotated[int, shared.search_option(min=0, metavar="N", help="Warm-up simulations at most.")] = 20,
    simulations: Annotated[
        int | None,
        shared.search_option(
            min=1,
            metavar="N",
            help="Simulations at most, in all; default 100, of a resumed run its own: --resume FOLDER --simulations "
            "200 goes on where 100 ended.",
        ),
    ] = None,
    seed: shared.Seed = 1234,
    workers: shared.SimulationWorkers = 0,
    settings: Annotated[
        list[str] | None,
        shared.search_option(
            "--set", metavar="KEY=VALUE", help="Any setting, patience=5 or feedback.use=overlay; repeat."
        ),
    ] = None,
    identifiability: Annotated[
        bool,
        shared.search_option(
            " /--no-identifiability",
            help="Make no analysis, after the search, of what the record fixes and what to measure next.",
            show_default=False,
        ),
    ] = True,
    language_model: shared.LanguageModel,
    exchange: Annotated[
        Path | None,
        shared.language_model_option(
            metavar="FOLDER", help="Where --backend manual puts prompts and finds replies, for another program."
        ),
    ] = None,
    votes: Annotated[
        int, shared.language_model_option(min=1, metavar="N", help="Merge this many independent replies a round.")
    ] = 1,
    review: Annotated[
        bool, shared.language_model_option("--review", help="Let a person accept, edit or refuse each proposal.")
    ] = False,
    max_tokens: shared.MaxTokens = None,
    max_cost: shared.MaxCost = None,
    out: Annotated[
        Path | None,
        shared.output_option(metavar="FOLDER", help="Folder of the run; default: runs/<task>-<scaffold>-<n>."),
    ] = None,
    resume: shared.Resume = None,
    as_json: Annotated[bool, shared.output_option("--json", help="Print result.json to standard output.")] = False,
    version: shared.Version = False,
) -> None:
    """Calibrate a model against a target: the packaged demo, a task file, or cycler records."""
    from ...core.run.allowance import Allowance
    from ...plugins.pybamm.before_search.offered_effects import with_offered
    from ..another_budget import asked_anew
    from ..checked_options import simulation_workers
    from ..request import RunRequest, run_request
    from ..run import Resources, discovery_command_of, read_request
    from ..run_settings import given_budgets, key_values
    from ..task_request import CellChoice, Records
    from ..tasks.find import find_task

    if out is not None:
        check_run_folder(out)
    resources = Resources(simulation_workers(workers), Allowance(max_tokens, max_cost))
    if resume is not None:
        taken = ("simulations", "rounds", "settings", "workers", "identifiability", "max_tokens", "max_cost", "as_json")
        shared.note_what_resuming_leaves(context, taken)
        budget = asked_anew(key_values(settings, "--set"), simulations=simulations, rounds=rounds)
        request = RunRequest(*read_request(resume, budget), resume)
        _execute(request, resources, as_json, identifiability, discovery_command_of(resume), resumed=True)
        return
    if data and task is not None:
        several = " Behind one --data stand files; of several folders, write --data before each." * Path(task).is_dir()
        raise BsaError(f'both a task ("{task}") and --data were given.', f"give one of them.{several}")
    budgets = given_budgets(rounds=rounds, warm_up=warmup, simulations=simulations, seed=seed)
    reached = language_model.options(exchange=exchange, votes=votes if votes > 1 else None, review=review or None)
    request = run_request(
        None if data else find_task(task or "demo"),
        Records(
            data or (),
            holdout or (),
            reading.readings(join),
            initial_soc or (),
            as_protocol,
            life,
            fit_cycles,
        ),
        CellChoice(parameters, model, key_values(options, "--options"), search, ocp, scale, start_from, effect or ()),
        scaffold,
        language_model.backend or "",
        reached,
        budgets | key_values(settings, "--set"),
        weight,
        out,
    )
    to_discover = ""
    if data and start_from is None and not request.task.long:
        fitted = with_offered(request.task, request.config.scaffold)
        typed = {
            "--parameters": request.folder if _goes_beyond_its_set(fitted, ocp, parameters) else parameters,
            "--model": model,
            "--options": options,
            "--no-scale": not scale,
            "--join": join,
            **reading.typed,
            "--initial-soc": initial_soc,
        }
        to_discover = discover_command(request.task, data, holdout or (), typed)
    _execute(request, resources, as_json, identifiability, to_discover)


def _goes_beyond_its_set(task: Task, ocp: str, parameters: str | None) -> bool:
    """Whether a discovery of what a fit leaves has to begin with the fitted cell.

    Its parameter set alone lacks the potentials that were chosen or corrected, or the effects.
    """
    from ...core.target import OcpShape
    from ...core.task import NEAREST

    corrected = any(isinstance(parameter.target, OcpShape) for parameter in task.space)
    return bool(ocp) or parameters == NEAREST or corrected or bool(task.cell.effects)


def _execute(
    request: RunRequest,
    resources: Any,
    as_json: bool,
    identifiability: bool,
    to_discover: str = "",
    resumed: bool = False,
) -> None:
    from ...backends.opening import ready_backend
    from ...core.metrics import objective_of
    from ..run import execute_run, larger_allowance, summary
    from .no_model import NoModelTold
    from .progress import LiveProgress, PlainProgress, note_line

    task, config, folder = request.task, request.config, request.folder
    unit = objective_of(task).of_unit
    backend, may_not_answer = ready_backend(config.backend, config.backend_options, (folder / FILE_NAME).exists())
    listener: LiveProgress | PlainProgress
    title = one_line(f"{task.name} · {config.scaffold.name} · {backend.name}")
    if sys.stderr.isatty() and not as_json and not _asks_a_person(config):
        listener = LiveProgress(title, unit, config.simulations, to_discover)
    else:
        listener = PlainProgress(unit, command=to_discover)
    print(f"{title} → {folder}", file=sys.stderr)
    if may_not_answer:
        print(note_line(may_not_answer), file=sys.stderr)
    if config.backend == "rules":
        backend = NoModelTold(backend, listener.noted)
    go_on = _resume_command(folder, identifiability)
    try:
        with resumable(folder, go_on), listener:
            result = execute_run(
                task,
                config,
                folder,
                backend,
                resources,
                listener,
                analysing=identifiability,
                to_discover=to_discover,
                rebudgeted=resumed,
            )
    except KeyboardInterrupt:
        if (folder / FILE_NAME).exists():
            print(f"Stopped: interrupted. Go on with: {go_on}", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None
        raise
    if as_json:
        print(json.dumps(summary(config, backend.name, result), indent=2))
    else:
        further = _how_to_go_on(result, config, folder, identifiability)
        _print_summary(result, folder, config.scaffold.made_for(task.simulator).simulator.use, further)
    if result.status in STOPPED:
        why = one_line(result.reason or result.status, 400)
        larger = larger_allowance(folder, result.usage)
        more = "".join(f" --{key.replace('_', '-')} {value}" for key, value in larger.items())
        print(f"Stopped: {why}. {one_line(result.advice, 600) or f'Go on with: {go_on}{more}'}", file=sys.stderr)
        raise typer.Exit(STOPPED[result.status])
    if result.cut_short:
        print(
            f"Stopped: interrupted. The search is finished; go on with what follows it with: {go_on}", file=sys.stderr
        )
        raise typer.Exit(INTERRUPTED)


def _asks_a_person(config: RunConfig) -> bool:
    """Whether a person answers at the terminal: what is redrawn there would wipe away what is typed."""
    options = config.backend_options
    return bool(options.get("review")) or (config.backend == "manual" and options.get("exchange") is None)


def _resume_command(folder: Path, identifiability: bool = True) -> str:
    return f"bsa-run --resume {shlex.quote(str(folder))}" + " --no-identifiability" * (not identifiability)


def _how_to_go_on(result: RunResult, config: RunConfig, folder: Path, identifiability: bool) -> Iterator[str]:
    """How a search or an analysis goes on with twice its budget, and what finds out what was not looked for."""
    from ..reply_notes import only_lost_rounds
    from ..report.post_fit import ended_by_itself, needs_more

    if result.status in STOPPED or result.cut_short:
        return
    if only_lost_rounds(result):
        pass  # A note says what may help.
    elif result.status.endswith("-spent") or result.reason:
        by_rounds = result.status == "rounds-spent"
        more = f"--rounds {2 * config.rounds or 1}" if by_rounds else f"--simulations {2 * config.simulations}"
        yield f"To search on: {_resume_command(folder, identifiability)} {more}"
    elif result.analysis is not None and needs_more(result.analysis, ended_by_itself(result.status, result.reason)):
        yield f"To go on with more simulations: {_resume_command(folder)} --simulations {2 * config.simulations}"
    if not identifiability and result.analysis is None and len(result.trials) > 1:
        yield f"What the record fixes was not looked for; to find out: {_resume_command(folder)}"


def _print_summary(result: RunResult, folder: Path, simulator: str, further: Iterable[str] = ()) -> None:
    from ...core.comparison.signal_metrics import MISFIT
    from ...core.metrics import headline_of, objective_of
    from ..report.forecast_line import forecast_line
    from ..report.page import FILE_NAME as REPORT
    from ..report.post_fit import (
        best_score_line,
        caution_line,
        ended_by_itself,
        groups_line,
        next_line,
        tolerance_line,
        verdict_line,
    )
    from ..report.records import error_rows
    from ..report.reduced_potentials import reduced_line
    from ..report.search_misfit import search_misfits
    from ..report.wording import losses, number

    task = result.task
    failed = sum(trial.failed for trial in result.trials)
    lost = f", {result.lost_calls} of {result.llm_calls} model calls lost" * bool(result.lost_calls)
    useless = losses(result.unusable_replies, result.llm_calls - result.lost_calls, result.lost_rounds)
    lost += f", {useless}" * bool(useless)
    left_out = "" if result.status in STOPPED else result.reason
    ended = result.status + ", short of simulations," * bool(left_out)
    more = f" and {result.low_fidelity_simulations} by the low-fidelity model" * bool(result.low_fidelity_simulations)
    spent = f"{counted(len(result.trials), 'simulation')} ({failed} failed){more}"
    print(f"{ended} after {spent}{lost}, {result.wall_s:.0f} s")
    if result.usage.tokens:
        print(f"  language model: {counted(result.llm_calls, 'call')}, {result.usage.words}")
    rows = [(one, one.shown(result.initial_metrics), one.shown(result.best_metrics)) for one in headline_of(task)]
    rows += [(one, *both) for one, both in search_misfits(task, result.trials[0], result.best).items()]
    width = max(len(quantity.words) for quantity, *_ in rows)
    for quantity, before, after in rows:
        print(f"  {quantity.words:{width}s} {number(before):>10s} → {number(after)} {quantity.unit}")
    if objective_of(task) is MISFIT:
        print(f"  ({tolerance_line(task)})")
    better = best_score_line(task, result.best, result.lowest, result.lowest_metrics)
    if better:
        print(f"  {better}")
    for row in error_rows(task, result.records, result.held_out):
        print(f"  {one_line(row.line, 600)}")
    for forecast, measured in zip(result.held_out, task.held_out, strict=False):
        if measured.long:
            print(f"  {one_line(forecast_line(forecast, measured), 400)}")
    if result.analysis is not None:
        verdict = verdict_line(result.analysis, ended_by_itself(result.status, result.reason))
        lines = [verdict, caution_line(result.analysis), groups_line(result.analysis)]
        lines.append(next_line(result.analysis, task.domain))
        print(*(f"  {line}" for line in lines if line), sep="\n")
    if reduced := reduced_line(task, result.best.candidate, simulator):
        print(f"  {one_line(reduced, 1000)}")
    if left_out:
        print(f"  {one_line(left_out, 600)}")
    for line in further:
        print(f"  {line}")
    print(f"  report: {folder / REPORT}")
