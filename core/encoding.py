"""Tasks, trials and proposals as JSON, and back, without loss."""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .ageing.cycle_table import COLUMNS, CycleTable
from .cell import CELL
from .domain import Domain
from .feedback import Feedback
from .metrics import decode_metrics
from .parameters import Parameter, ParameterSpace
from .proposal import Proposal
from .protocol_text import read_protocol, written
from .shape import shaped
from .signals import Signal
from .simulation import ExperimentRun, Outcome, SimulationFailure
from .target import (
    CurrentOffset,
    CyclableLithium,
    DiffusivityShape,
    EffectValue,
    Factor,
    InitialSoc,
    InitialVoltage,
    OcpShape,
    Target,
    Value,
    target_named,
)
from .task import CellModel, Experiment, Task, Weight
from .task_reduction import TaskReduction
from .trajectory import FloatArray, Step, Trajectory
from .trial import Phase, Trial

Json = dict[str, Any]

_MOST_BYTES = 2**29
"""Bytes of an array: more than any record has that a reader takes, where a small text may unpack to terabytes."""


@dataclass(frozen=True)
class _ExperimentRecord:
    name: str
    target: dict[str, Any]
    protocol: list[list[str] | str] | None
    scored_cycle: int | None
    temperature_k: float | None
    initial_soc: float | None
    initial_voltage: float | None = None
    detailed_cycles: tuple[int, ...] = ()
    initial_temperature_k: float | None = None


@dataclass(frozen=True)
class _TaskRecord:
    name: str
    cell: CellModel
    space: list[dict[str, Any]]
    experiments: list[_ExperimentRecord]
    notes: tuple[str, ...]
    domain: dict[str, Any] | None = None
    signals: tuple[Signal, ...] = ()
    simulator: str = ""
    held_out: tuple[_ExperimentRecord, ...] = ()
    weight: Weight = "uniform"


@dataclass(frozen=True)
class TrialRecord:
    """A trial as it stands in a journal."""

    index: int
    phase: Phase
    round: int
    candidate: dict[str, float]
    metrics: dict[str, Any] | None
    failure: SimulationFailure | None
    residuals: str | None
    feedback: dict[str, Any]
    images: list[str]
    curves: list[dict[str, Any] | None]
    seconds: float
    # Journals of before tasks could be reduced have neither.
    reduction: TaskReduction | None = None
    partial: str | None = None
    limits: tuple[str, ...] = ()


def encode_array(values: FloatArray) -> str:
    """An array of shape (n,) as text that keeps every bit (zlib-packed little-endian float64, base64)."""
    return base64.b64encode(zlib.compress(np.asarray(values, dtype="<f8").tobytes())).decode("ascii")


def decode_array(text: str) -> FloatArray:
    """The inverse of `encode_array`. Raises `ValueError` if the text is no array, or one of more than `_MOST_BYTES`."""
    packed = zlib.decompressobj()
    try:
        content = packed.decompress(base64.b64decode(text, validate=True), _MOST_BYTES)
    except zlib.error as error:
        raise ValueError(f"no packed array ({error})") from None
    if not packed.eof:
        raise ValueError("a packed array that is cut short or too long")
    return np.frombuffer(content, dtype="<f8").astype(np.float64)


_TABLE = ("cycle", *COLUMNS)
_NO_SIGNALS = ("time", "steps", "cycle_table", "inserted")


def encode_trajectory(trajectory: Trajectory) -> Json:
    """A trajectory with its steps."""
    record: Json = {
        "time": encode_array(trajectory.time),
        **{name: encode_array(values) for name, values in trajectory.signals.items()},
        "steps": [asdict(step) for step in trajectory.steps],
    }
    table = trajectory.cycle_table
    if table is not None:
        record["cycle_table"] = {name: encode_array(getattr(table, name)) for name in _TABLE}
    if np.any(trajectory.inserted):
        record["inserted"] = np.flatnonzero(trajectory.inserted).tolist()
    return record


def decode_trajectory(record: Mapping[str, Any]) -> Trajectory:
    """The inverse of `encode_trajectory`."""
    time = decode_array(record["time"])
    steps: tuple[Step, ...] = shaped(tuple[Step, ...], record["steps"])
    if not all(0 <= step.start <= step.stop <= len(time) for step in steps):
        raise ValueError(f"a step outside the {len(time)} samples")
    signals = {name: decode_array(text) for name, text in record.items() if name not in _NO_SIGNALS}
    table = {name: decode_array(text) for name, text in record.get("cycle_table", {}).items() if name in _TABLE}
    inserted = np.isin(np.arange(len(time)), shaped(tuple[int, ...], record.get("inserted", [])))
    return Trajectory(
        time, steps=steps, signals=signals, cycle_table=CycleTable(**table) if table else None, inserted=inserted
    )


_TARGETS: dict[str, type[Target]] = {
    "value": Value,
    "factor": Factor,
    "initial_soc": InitialSoc,
    "initial_voltage": InitialVoltage,
    "current_offset": CurrentOffset,
    "cyclable_lithium": CyclableLithium,
    "ocp_shape": OcpShape,
    "diffusivity_shape": DiffusivityShape,
    "effect": EffectValue,
}


def encode_parameter(parameter: Parameter) -> Json:
    """A searched parameter with what it acts on."""
    target = parameter.target
    kind = next((kind for kind, of in _TARGETS.items() if type(target) is of), None)
    acts_on = None if kind is None or target is None else {"kind": kind, **asdict(target)}
    content = {**asdict(parameter), "target": acts_on}
    if parameter.expected is None:
        del content["expected"]
    return content


def decode_parameter(record: Mapping[str, Any]) -> Parameter:
    """The inverse of `encode_parameter`; a record of an earlier version names its target by the parameter's name."""
    acts_on = record.get("target")
    target = None if "target" in record else target_named(record["name"])
    if acts_on is not None:
        target = shaped(_TARGETS[acts_on["kind"]], {key: value for key, value in acts_on.items() if key != "kind"})
    parameter: Parameter = shaped(Parameter, {**record, "target": None})
    return replace(parameter, target=target)


def encode_task(task: Task) -> Json:
    """A task with its records. What is the same for all tasks of a cell is left out, as it always was."""
    return {
        **_encode_domain(task),
        "name": task.name,
        "cell": encode_cell(task.cell),
        "space": [encode_parameter(parameter) for parameter in task.space],
        "experiments": [_encode_experiment(experiment) for experiment in task.experiments],
        **({"held_out": [_encode_experiment(experiment) for experiment in task.held_out]} if task.held_out else {}),
        **({"weight": task.weight} if task.weight != "uniform" else {}),
        "notes": list(task.notes),
    }


def encode_cell(cell: CellModel) -> Json:
    """A cell model; without effects as it always was."""
    mappings = ("options", "overrides", "strengths", "offered")
    own: Json = {**asdict(cell), **{name: dict(getattr(cell, name)) for name in mappings}}
    return {name: value for name, value in own.items() if value or name not in ("effects", "strengths", "offered")}


def _encode_experiment(experiment: Experiment) -> Json:
    content: Json = {
        **vars(experiment),
        "target": encode_trajectory(experiment.target),
        "protocol": None if experiment.protocol is None else written(experiment.protocol),
        "detailed_cycles": list(experiment.detailed_cycles) or None,
    }
    later = ("initial_voltage", "detailed_cycles", "initial_temperature_k")
    return {name: value for name, value in content.items() if value is not None or name not in later}


def _decode_experiment(known: _ExperimentRecord) -> Experiment:
    protocol = None if known.protocol is None else read_protocol(known.protocol)
    return Experiment(**{**vars(known), "target": decode_trajectory(known.target), "protocol": protocol})


def _encode_domain(task: Task) -> Json:
    record: Json = {"simulator": task.simulator} if task.simulator else {}
    if task.domain != CELL:
        record["domain"] = asdict(replace(task.domain, rules=tuple(dict(rule) for rule in task.domain.rules)))
    if task.signals != task.domain.signals:
        record["signals"] = [asdict(signal) for signal in task.signals]
    return record


def decode_task(record: Mapping[str, Any]) -> Task:
    """The inverse of `encode_task`.

    Raises `ValueError`, `LookupError`, `TypeError` or `BsaError` if the record is of another shape.
    """
    known: _TaskRecord = shaped(_TaskRecord, record)
    decoded: Json = {
        "space": ParameterSpace(tuple(decode_parameter(parameter) for parameter in known.space)),
        "experiments": tuple(_decode_experiment(experiment) for experiment in known.experiments),
        "domain": CELL if known.domain is None else shaped(Domain, known.domain),
        "held_out": tuple(_decode_experiment(experiment) for experiment in known.held_out),
    }
    return Task(**{**vars(known), **decoded})


def encode_trial(trial: Trial, folder: Path) -> Json:
    """A trial; image paths are stored relative to the run's folder."""
    return {
        "index": trial.index,
        "phase": trial.phase,
        "round": trial.round,
        "candidate": dict(trial.candidate),
        "metrics": None if trial.metrics is None else trial.metrics.as_json(),
        "failure": None if trial.failure is None else asdict(trial.failure),
        "residuals": None if trial.residuals is None else encode_array(trial.residuals),
        "feedback": dict(trial.feedback.content),
        "images": [str(image.relative_to(folder)) for image in trial.feedback.images],
        "curves": [None if curve is None else encode_trajectory(curve) for curve in trial.curves],
        "seconds": trial.seconds,
        "reduction": None if trial.reduction is None else asdict(trial.reduction),
        "partial": None if trial.partial is None else encode_array(trial.partial),
        "limits": list(trial.limits),
    }


def decode_trial(record: Mapping[str, Any], folder: Path) -> Trial:
    """The inverse of `encode_trial`.

    Raises `ValueError`, `LookupError`, `TypeError` or `BsaError` if the record is of another shape.
    """
    fields = {**vars(shaped(TrialRecord, record))}
    images = [Path(image) for image in fields.pop("images")]
    if any(image.is_absolute() or ".." in image.parts for image in images):
        # It would be shown to a language model.
        raise ValueError("an image outside the run's folder")
    decoded: Json = {
        "metrics": decode_metrics(fields["metrics"]),
        "feedback": Feedback(fields["feedback"], tuple(folder / image for image in images)),
        "curves": tuple(None if curve is None else decode_trajectory(curve) for curve in fields["curves"]),
        "residuals": None if fields["residuals"] is None else decode_array(fields["residuals"]),
        "partial": None if fields["partial"] is None else decode_array(fields["partial"]),
    }
    return Trial(**{**fields, **decoded})


def encode_outcome(outcome: Outcome) -> Json:
    """What a simulation gave, whole."""
    runs = [
        {
            "trajectory": None if run.trajectory is None else encode_trajectory(run.trajectory),
            "failure": None if run.failure is None else asdict(run.failure),
            "limits": list(run.limits),
            "at_limit": [list(times) for times in run.at_limit],
        }
        for run in outcome.runs
    ]
    return {"runs": runs, "seconds": outcome.seconds}


def decode_outcome(record: Mapping[str, Any]) -> Outcome:
    """The inverse of `encode_outcome`."""
    runs = (
        ExperimentRun(
            None if run["trajectory"] is None else decode_trajectory(run["trajectory"]),
            None if run["failure"] is None else shaped(SimulationFailure, run["failure"]),
            shaped(tuple[str, ...], run.get("limits", [])),
            shaped(tuple[tuple[float, float], ...], run.get("at_limit", [])),
        )
        for run in record["runs"]
    )
    return Outcome(tuple(runs), float(record["seconds"]))


def encode_proposal(proposal: Proposal) -> Json:
    """A proposal; its candidates are in its trials, only their number is kept."""
    return {**asdict(proposal), "candidates": len(proposal.candidates)}
