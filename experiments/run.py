"""One run from its task and configuration to its folder: journal, results, report."""

import json
import math
import platform
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ..core.contracts.registry import installed
from ..core.encoding import decode_task, encode_task
from ..core.errors import BsaError
from ..core.files import write_json, write_text
from ..core.hooks import RunContext
from ..core.messages import Backend, Usage
from ..core.metrics import Metrics, errors_of
from ..core.run.allowance import UNLIMITED, Allowance, allowance_of, kept_allowance
from ..core.run.budget import with_budget
from ..core.run.journal import FILE_NAME, FORMAT, Journal, check_calibration, opened, read_events
from ..core.run.listener import SILENT, Listener
from ..core.run.loop import Run, RunResult
from ..core.run.recording import Recorder
from ..core.run.run_config import RunConfig
from ..core.run.run_plugins import RunPlugins
from ..core.shape import decoding, shaped
from ..core.task import Task
from ..core.validation import validated
from ..plugins.pybamm.before_search.offered_effects import with_offered
from .another_budget import budget_of, check_budget, given_anew, nothing_added, resuming_with, write_budget
from .misfit_notes import misfit_notes
from .offered_notes import offered_notes
from .reply_notes import reply_notes
from .run_record import read_run

RESULT = "result.json"


@dataclass(frozen=True)
class Resources:
    """What a run may use; none of it changes what the run finds."""

    workers: int = 1  # Simulations side by side.
    # For the language model; once spent, the run stops and can be resumed. What is None is as the run had it before.
    allowance: Allowance = UNLIMITED


def versions() -> dict[str, str]:
    """What is installed, by distribution, and the Python version."""
    found = {"python": platform.python_version()}
    for name in ("battery-sim-agent", "pybamm", "numpy", "scipy"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def execute_run(
    task: Task,
    config: RunConfig,
    folder: Path,
    backend: Backend,
    resources: Resources | None = None,
    listener: Listener = SILENT,
    report: bool = True,
    analysing: bool = False,
    to_discover: str = "",
    rebudgeted: bool = False,
) -> RunResult:
    """Run a task in a folder, or go on where an interrupted run of the same task and configuration stopped.

    Journal, results and report go to the folder, those of a life first when its later cycles are forecast; the backend
    is closed at the end. Without ``report`` no ``report.html`` is written: the journal is enough to write it later.
    ``analysing`` finds out after the search what the records fix and what to measure next; studies count simulations
    and leave it out. ``to_discover`` is the command that looks for what the model lacks; it is told where the misfit of
    the best candidate is no noise. ``rebudgeted`` lets the configuration allow more simulations, rounds and patience
    than the run had; what it has simulated stands. Raises `BsaError` if the folder holds a run of another task or
    configuration, the budget is smaller than what was simulated, or a plugin cannot be used.
    """
    from .report.forecast_line import forecast_line
    from .report.page import FILE_NAME as REPORT
    from .report.page import build_report

    resources = resources or Resources()
    config = config.model_copy(update={"scaffold": config.scaffold.made_for(task.simulator)})
    task = with_offered(task, config.scaffold)
    with closing(backend), opened(folder, "trial") as book:
        journal, earlier = book.file, book.earlier
        if any(event["event"] == "trial" for event in earlier):
            read_run(folder)  # What does not read must be refused before more is written behind it.
        _open_chapter(journal, earlier, task, config, to_discover, rebudgeted)
        recorder = Recorder(journal, earlier, kept_allowance(journal, earlier, resources.allowance))
        recorder.say, recorder.asked = listener.noted, listener.asked
        context = RunContext(task, config.seed, folder, recorder.around(backend), resources.workers, listener.cycled)

        def note(text: str) -> None:
            journal.append("note", text=text)
            listener.noted(text)

        with closing(RunPlugins(config.scaffold, context, installed(), note)) as plugins:
            for text in (*task.notes, *journal.warnings):
                listener.noted(text)

            write = partial(_write_products, folder, config, backend.name, plugins)

            def forecast(result: RunResult) -> None:
                write(result)
                if report:
                    build_report(folder)
                for one, measured in zip(result.held_out, task.held_out, strict=True):
                    listener.noted(forecast_line(one, measured))
                listener.noted(f"{folder / (REPORT if report else RESULT)} has it; its 95 % band follows.")

            result = Run(
                task, config, plugins, recorder, journal, folder, earlier, listener, analysing, forecast
            ).execute()
            if said := nothing_added(folder, earlier, config, result):
                note(said)
            notes = list(reply_notes(result))
            if result.status not in ("interrupted", "outage"):
                notes += offered_notes(task, result.trials)
            if to_discover:
                notes += misfit_notes(result.task, result.best, to_discover, task.cell.offered)
            for text in notes:
                note(text)
            write(result)
    if report:
        build_report(folder)
    return result


def _write_products(folder: Path, config: RunConfig, backend_name: str, plugins: RunPlugins, result: RunResult) -> None:
    """Write ``result.json``, ``best_parameters.json`` and what the simulator exports, each whole or not at all."""
    write_json(folder / RESULT, summary(config, backend_name, result), indent=2)
    write_json(folder / "best_parameters.json", dict(result.best.candidate), indent=2)
    for name, content in plugins.export(result.best.candidate).items():
        write_text(folder / name, content)


def _open_chapter(
    journal: Journal, earlier: list[dict[str, Any]], task: Task, config: RunConfig, to_discover: str, rebudgeted: bool
) -> None:
    """Write the first line of a fresh journal, or check that the old one belongs to this task and configuration."""
    encoded, dumped = encode_task(task), config.model_dump(mode="json")
    if not earlier:
        now = versions()
        identity = config.identity(encoded, now)
        advice = {"to_discover": to_discover} if to_discover else {}
        journal.append("run", format=FORMAT, identity=identity, config=dumped, versions=now, task=encoded, **advice)
        return
    first = earlier[0]
    check_calibration(first, journal.path)
    known = with_budget(first.get("config", {}), earlier)
    same = {**known, **budget_of(config)} == dumped and first.get("task") == json.loads(json.dumps(encoded))
    given = given_anew(known, config)
    if not same or (given and not rebudgeted):
        raise BsaError(
            f"{journal.path} belongs to another task or configuration.",
            "choose another --out folder, or resume with --resume alone."
            if not same
            else f"choose another --out folder, or go on with that run: {resuming_with(journal.path.parent, given)}",
        )
    if given:
        check_budget(journal.path, earlier, known, config)
    go_on(journal, first)
    if given:
        write_budget(journal, earlier, known, config)


def go_on(journal: Journal, first: Mapping[str, Any]) -> None:
    """Write that a run or a discovery was taken up again, and warn of other versions than it began with."""
    began, now = first.get("versions", {}), versions()
    changed = [f"{name} {began.get(name)} -> {now[name]}" for name in now if began.get(name) != now[name]]
    if changed:
        journal.warnings.append(f"Resumed with other versions than the run began with: {', '.join(changed)}.")
    journal.append("resumed", versions=now)


def discovery_command_of(folder: Path) -> str:
    """The command that looks for what the model of an earlier run lacks; empty where its journal names none."""
    return str(next(read_events(folder), {}).get("to_discover", ""))


def larger_allowance(folder: Path, usage: Usage) -> dict[str, float]:
    """Twice the limits that a run has reached with so much, by option; empty where another thing stopped it."""
    return allowance_of(read_events(folder)).larger(usage.tokens, usage.cost_usd or 0.0)


def read_request(folder: Path, budget: Mapping[str, Any] | None = None) -> tuple[Task, RunConfig]:
    """The task and configuration of an earlier run, from its journal, with another budget where one is given.

    ``budget`` has any of the simulations, rounds and patience.

    Raises `BsaError` if the folder holds no run, or a budget is none.
    """
    path = folder / FILE_NAME
    events = list(read_events(folder))
    first = events[0] if events else {}
    check_calibration(first, path)
    with decoding(path, "a run", "restore the file, or start a new run."):
        task, config = decode_task(first["task"]), shaped(RunConfig, with_budget(first["config"], events))
    return task, validated(RunConfig, {**config.model_dump(), **budget}, "run configuration") if budget else config


def summary(config: RunConfig, backend_name: str, result: RunResult) -> dict[str, Any]:
    """What ``result.json`` holds: ``best`` is the run's answer, ``best_score`` the trial with the lowest objective."""
    task = result.task
    return {
        "task": task.name,
        "scaffold": config.scaffold.name,
        "backend": backend_name,
        "seed": config.seed,
        "status": result.status,
        "reason": result.reason,
        "simulations": len(result.trials),
        "failed_simulations": sum(trial.failed for trial in result.trials),
        "low_fidelity_simulations": result.low_fidelity_simulations,
        "llm_calls": result.llm_calls,
        "lost_calls": result.lost_calls,
        "unusable_replies": result.unusable_replies,
        "lost_rounds": result.lost_rounds,
        "tokens": result.usage.tokens,
        "cost_usd": result.usage.cost_usd,
        "wall_s": result.wall_s,
        "simulator_s": result.simulator_s,
        "low_fidelity_s": result.low_fidelity_s,
        "backend_s": result.usage.seconds,
        "identifiability_simulations": 0 if result.analysis is None else result.analysis.simulations,
        "initial": _numbers(task, result.initial_metrics),
        "best": {
            **_numbers(task, result.best_metrics),
            "trial": result.best.index,
            "phase": result.best.phase,
            "round": result.best.round,
            "parameters": dict(result.best.candidate),
        },
        "best_score": {**_numbers(task, result.lowest_metrics), "trial": result.lowest.index},
        "records": [
            *({"fitted": True, **record.as_json()} for record in result.records),
            *({"fitted": False, **prediction.as_json()} for prediction in result.held_out),
        ],
        "identifiability": None if result.analysis is None else result.analysis.as_json(),
        "versions": versions(),
    }


def _numbers(task: Task, metrics: Metrics | None) -> dict[str, float | None]:
    keys = ["objective", *(quantity.key for quantity in errors_of(task))]
    found = {key: math.nan if metrics is None else metrics.value(key) for key in keys}
    return {key: None if math.isnan(value) else value for key, value in found.items()}
