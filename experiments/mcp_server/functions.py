"""What the tools do, as JSON in and out; what simulates runs in a process of its own."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scipy.constants import zero_Celsius

from ...core.contracts.registry import installed
from ...core.errors import unknown
from ...core.files import load_json
from ...core.hooks import RunContext
from ...core.metrics import errors_of, evaluate
from ...core.parameters import Candidate
from ...core.reading.summary import summary
from ...core.run.budget import with_budget
from ...core.run.journal import read_events
from ...core.run.run_plugins import RunPlugins
from ...core.scaffold import load_scaffold
from ...core.simulation import in_order
from ...core.task import NEAREST, Task
from ...core.trajectory import Trajectory
from ..api import calibration, discovery, measured
from ..api.calibration_result import CalibrationResult
from ..api.discovery_result import DiscoveryResult
from ..discovery_journal import KIND, read_options
from ..discovery_journal import RESULT as DISCOVERY_RESULT
from ..read_options import reading
from ..report.page import FILE_NAME as REPORT
from ..task_request import CellChoice, Records, task_of_records
from ..tasks.find import find_task
from .arguments import is_name

Json = dict[str, Any]

_MOST_STEPS, _MOST_SAMPLES = 200, 200
"""Rows of a table that an assistant is shown: what it can still read."""


def read_record(path: Path, options: Mapping[str, Any]) -> Json:
    """A record's steps, and what was assumed or repaired."""
    record = measured.read_record(path, **options)
    trajectory = record.trajectory
    return {
        "name": record.name,
        "samples": len(trajectory),
        "duration_s": trajectory.duration,
        "cycles": list(trajectory.cycles),
        "steps": [asdict(row) for row in summary(record).steps[:_MOST_STEPS]],
        "steps_in_all": len(trajectory.steps),
        "ambient_c": None if record.ambient_k is None else round(record.ambient_k - zero_Celsius, 2),
        "notes": list(record.notes),
        "sign": "current is positive on discharge",
    }


def simulate(
    data: str | list[Path], options: Mapping[str, Any], cell: Mapping[str, Any], values: Mapping[str, float]
) -> Json:
    """A task at given parameter values, scored with reference accuracy."""
    task = _task(data, options, cell)
    candidate = _candidate(task, values)
    with _plugins(task) as plugins:
        ((_, outcome),) = plugins.simulate([candidate], exact=True)
        metrics = evaluate(task, outcome)
        told = plugins.build_feedback(outcome, metrics, 0).content
    return {
        "values": candidate,
        "failure": None if outcome.failure is None else outcome.failure.cause,
        "limits": list(outcome.limits),
        "errors": {f"{one.label} [{one.unit}]": one.shown(metrics) for one in errors_of(task)},
        "feedback": dict(told),
        "curves": [_curve(run.trajectory) for run in outcome.runs],
    }


def _curve(trajectory: Trajectory | None) -> Json | None:
    if trajectory is None:
        return None
    stride = -(-len(trajectory) // _MOST_SAMPLES)
    signals = {"time_s": trajectory.time, **trajectory.signals}
    return {name: [float(f"{value:.6g}") for value in values[::stride]] for name, values in signals.items()}


def sensitivities(
    data: str | list[Path], options: Mapping[str, Any], cell: Mapping[str, Any], values: Mapping[str, float]
) -> Json:
    """What a typical step of each parameter does to each feature of the match."""
    task = _task(data, options, cell)
    base = _candidate(task, values)
    # Upwards at an upper bound there is no room.
    moved = {one.name: {**base, one.name: one.a_step_aside(base[one.name])} for one in task.space}
    with _plugins(task) as plugins:
        outcomes = in_order(plugins.simulate([base, *moved.values()], exact=False))
        start, *ends = (
            plugins.build_feedback(outcome, evaluate(task, outcome), place).numbers
            for place, outcome in enumerate(outcomes)
        )
    effects = {}
    for one, end in zip(task.space, ends, strict=True):
        steps = one.in_steps(moved[one.name][one.name]) - one.in_steps(base[one.name])
        change = {feature: (end[feature] - start[feature]) / steps for feature in start if feature in end}
        effects[one.name] = {feature: float(f"{effect:.3g}") for feature, effect in change.items()}
    return {
        "values": base,
        "steps": {one.name: one.typical_step for one in task.space},
        "features": start,
        "changes": effects,
        "failed": {name: o.failure.cause for name, o in zip(moved, outcomes[1:], strict=True) if o.failure},
    }


def calibrate(options: Mapping[str, Any]) -> Json:
    """A calibration; see `bsa.calibrate`."""
    _check_set(options.get("parameters"))
    data = options.get("data")
    given = {**options, "data": find_task(data)} if isinstance(data, str) else options
    return _calibrated(calibration.calibrate(**given, progress=False))


def discover(options: Mapping[str, Any]) -> Json:
    """A discovery; see `bsa.discover`."""
    resumed = options.get("resume")
    _check_set((options if resumed is None else begun_with(resumed)[0]).get("parameters"))
    found = discovery.discover(**options, progress=False)
    return _told(found, verdict=found.verdict, headline=found.headline, effects=list(found.effects))


def report(folder: Path) -> Json:
    """What came of a calibration or a discovery, from its folder."""
    found = folder / DISCOVERY_RESULT
    if not found.is_file():
        return _calibrated(CalibrationResult.of(folder))
    content: Json = load_json(found, "discover again, into another folder.")
    return {**content, "folder": str(folder), "report": str(folder / REPORT)}


def simulations_of(folder: Path) -> int | None:
    """How many simulations a run may have at most; None where there is no such run."""
    events = list(read_events(folder))
    config = events[0].get("config") if events else None
    allowed = with_budget(config, events).get("simulations") if isinstance(config, Mapping) else None
    return allowed if isinstance(allowed, int) else None


def begun_with(folder: Path) -> tuple[Mapping[str, Any], list[str]]:
    """The settings with which a calibration or discovery was begun, and the files that it reads anew when it goes on.

    Both are empty where no run was begun. Raises `BsaError` if the journal of a discovery cannot be read.
    """
    first = next(read_events(folder), {})
    if first.get("kind") != KIND:
        config = first.get("config")
        return config if isinstance(config, Mapping) else {}, []  # a calibration keeps its records in the journal
    options = read_options(folder)
    files = [str(path) for file in options.files for path in file.files]
    others = [given for given in (options.parameters, options.search) if isinstance(given, str) and not is_name(given)]
    return options.model_dump(), [*files, *others]


def _task(data: str | list[Path], options: Mapping[str, Any], cell: Mapping[str, Any]) -> Task:
    """The task of that name, or of matching records."""
    if isinstance(data, str):
        return find_task(data)
    _check_set(cell.get("parameters"))
    return task_of_records(Records(data, reads=[reading(**options)]), CellChoice(**cell))


def _check_set(parameters: str | None) -> None:
    """Refuse a name that no installed set has: it would be looked for where the server was started."""
    if parameters is not None and is_name(parameters) and parameters != NEAREST:
        from ...plugins.pybamm.cells.parameter_sets import require_set

        require_set(parameters)


def _calibrated(found: CalibrationResult) -> Json:
    return _told(found, status=found.status)


def _told(found: CalibrationResult | DiscoveryResult, **head: Any) -> Json:
    """What a calibration or a discovery found, behind what only one of them has."""
    return {
        **head,
        "errors": found.errors,
        "parameters": found.parameters,
        "intervals_95": found.intervals,
        "notes": list(found.notes),
        "folder": str(found.folder),
        "report": str(found.report),
    }


def _candidate(task: Task, values: Mapping[str, float]) -> Candidate:
    others = [name for name in values if name not in task.space]
    if others:
        message = f'"{others[0]}" is not searched in this task.'
        raise unknown(message, others[0], task.space.names, "searched are {}.")
    return task.space.project({**task.space.initial, **values})


@contextmanager
def _plugins(task: Task) -> Iterator[RunPlugins]:
    """The simulator of a task, and a feedback builder."""
    scaffold = load_scaffold("default").made_for(task.simulator)
    with tempfile.TemporaryDirectory() as folder:
        plugins = RunPlugins(scaffold, RunContext(task, 1, Path(folder)), installed())
        try:
            yield plugins
        finally:
            plugins.close()
