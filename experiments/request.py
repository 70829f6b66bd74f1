"""From what a person typed to what a run needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from ..core.errors import BsaError
from ..core.run.run_config import RunConfig
from ..core.task import Task, Weight
from .file_reading import FileReading
from .run_names import numbered_folder
from .run_settings import run_config
from .task_request import CellChoice, Records, task_of_records


@dataclass(frozen=True)
class RunRequest:
    """A run that is about to start."""

    task: Task  # What is to be matched.
    config: RunConfig  # Scaffold, budgets, seed.
    folder: Path  # Where it goes.


def run_request(
    named: Task | None,
    records: Records,
    cell: CellChoice,
    scaffold: str | None,
    backend: str,
    backend_options: Mapping[str, Any],
    settings: Mapping[str, Any],
    weight: str | None,
    out: Path | None,
) -> RunRequest:
    """What a run is asked: a task that was named, with the records that it is to hold out, or that of matching records.

    ``scaffold`` is None where none is named; ``settings`` are as in `run_config`. ``weight`` is how errors count; None
    leaves it to the task. ``out`` is None for a new folder under ``runs``. Raises `BsaError` if any of it makes no
    sense.
    """
    from .tasks.records import holding_out

    if named is not None:
        _check_of_task(named, records, cell)
    simulator = "" if named is None else named.simulator
    config = run_config(scaffold or "hybrid", backend, backend_options, settings, simulator)
    task = task_of_records(records, cell) if named is None else holding_out(named, records.held_out_requests())
    if weight is not None:
        task = replace(task, weight=cast("Weight", weight))
    # A language model needs a scaffold that asks it.
    if scaffold is None and config.backend == "rules" and _goes_in_stages(task):
        config = run_config("staged", backend, backend_options, settings, simulator)
    return RunRequest(task, config, out or numbered_folder(Path("runs"), f"{task.name}-{config.scaffold.name}"))


def _goes_in_stages(task: Task) -> bool:
    """Whether the priors of a task are weighed where no scaffold is named: those of a fit to measured currents are."""
    return task.given_drive and not task.long and bool(task.space.prior_weights.any())


def _check_of_task(named: Task, records: Records, cell: CellChoice) -> None:
    """Refuse what goes with records where a task was named, which says it itself."""
    said = {
        "--parameters": cell.parameters is not None,
        "--start-from": cell.start_from is not None,
        "--model": cell.model is not None,
        "--options": bool(cell.options),
        "--search": cell.search is not None,
        "--effect": bool(cell.effects),
        "--ocp": bool(cell.ocp),
        "--no-scale": not cell.scale,
        "--initial-soc": bool(records.initial_soc),
        "--as-protocol": records.as_protocol,
        "--life": records.life,
        "--fit-cycles": records.fit_cycles is not None,
        "options for reading": not records.held_out and list(records.reads) != [FileReading()],
    }
    refuse_beside_task([name for name, is_given in said.items() if is_given], named.name)


def refuse_beside_task(given: Sequence[str], task: str) -> None:
    """Raise `BsaError` if anything was given that goes with records, where a task was named."""
    if given:
        verb = "go" if len(given) > 1 or " " in given[0] else "goes"
        raise BsaError(
            f'{", ".join(given)} {verb} with records, but "{task}" is a task, which has its own.',
            "give records as data, or leave that out; a task file says it under keys of its own.",
        )
