"""Tasks, trials and proposals as JSON, and back, without loss."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from .cell import CELL
from .domain import Domain
from .easing import Easing
from .feedback import Feedback
from .metrics import decode_metrics
from .parameters import Parameter, ParameterSpace
from .proposal import Proposal
from .signals import Signal
from .simulation import ExperimentRun, Outcome, SimulationFailure
from .target import CyclableLithium, EffectValue, Factor, InitialSoc, Target, Value, target_named
from .task import CellModel, Experiment, Task
from .trajectory import FloatArray, Step, Trajectory
from .trial import Trial

Json = dict[str, Any]


def encode_array(values: FloatArray) -> str:
    """An array of shape (n,) as text that keeps every bit (zlib-packed little-endian float64, base64)."""
    return base64.b64encode(zlib.compress(np.asarray(values, dtype="<f8").tobytes())).decode("ascii")


def decode_array(text: str) -> FloatArray:
    """The inverse of `encode_array`."""
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype="<f8").astype(np.float64)


def encode_trajectory(trajectory: Trajectory) -> Json:
    """A trajectory with its steps."""
    signals = {name: encode_array(values) for name, values in trajectory.signals.items()}
    return {"time": encode_array(trajectory.time), **signals, "steps": [asdict(step) for step in trajectory.steps]}


def decode_trajectory(record: Mapping[str, Any]) -> Trajectory:
    """The inverse of `encode_trajectory`."""
    return Trajectory(
        decode_array(record["time"]),
        steps=tuple(Step(**step) for step in record["steps"]),
        signals={name: decode_array(text) for name, text in record.items() if name not in ("time", "steps")},
    )


_TARGETS: dict[str, type[Target]] = {
    "value": Value,
    "factor": Factor,
    "initial_soc": InitialSoc,
    "cyclable_lithium": CyclableLithium,
    "effect": EffectValue,
}


def encode_parameter(parameter: Parameter) -> Json:
    """A searched parameter with what it acts on."""
    target = parameter.target
    kind = next((kind for kind, of in _TARGETS.items() if type(target) is of), None)
    acts_on = None if kind is None or target is None else {"kind": kind, **asdict(target)}
    return {**asdict(parameter), "target": acts_on}


def decode_parameter(record: Mapping[str, Any]) -> Parameter:
    """The inverse of `encode_parameter`; a record of an earlier version names its target by the parameter's name."""
    if "target" not in record:
        return Parameter(**record, target=target_named(record["name"]))
    acts_on = record["target"]
    if acts_on is None:
        return Parameter(**record)
    content = {key: value for key, value in acts_on.items() if key != "kind"}
    return Parameter(**{**record, "target": _TARGETS[acts_on["kind"]](**content)})


def encode_task(task: Task) -> Json:
    """A task with its records. What is the same for all tasks of a cell is left out, as it always was."""
    return {
        **_encode_domain(task),
        "name": task.name,
        "cell": {**asdict(task.cell), "options": dict(task.cell.options), "overrides": dict(task.cell.overrides)},
        "space": [encode_parameter(parameter) for parameter in task.space],
        "experiments": [
            {
                "name": experiment.name,
                "target": encode_trajectory(experiment.target),
                "protocol": experiment.protocol,
                "scored_cycle": experiment.scored_cycle,
                "temperature_k": experiment.temperature_k,
                "initial_soc": experiment.initial_soc,
            }
            for experiment in task.experiments
        ],
        "notes": list(task.notes),
    }


def _encode_domain(task: Task) -> Json:
    record: Json = {"simulator": task.simulator} if task.simulator else {}
    if task.domain != CELL:
        record["domain"] = asdict(replace(task.domain, rules=tuple(dict(rule) for rule in task.domain.rules)))
    if task.signals != task.domain.signals:
        record["signals"] = [asdict(signal) for signal in task.signals]
    return record


def _decode_domain(record: Mapping[str, Any]) -> Domain:
    if "domain" not in record:
        return CELL
    content = dict(record["domain"])
    return Domain(**{**content, "rules": tuple(content["rules"]), "signals": _decode_signals(content["signals"])})


def _decode_signals(records: Iterable[Mapping[str, Any]]) -> tuple[Signal, ...]:
    return tuple(Signal(**{**record, "observed_in": tuple(record["observed_in"])}) for record in records)


def decode_task(record: Mapping[str, Any]) -> Task:
    """The inverse of `encode_task`."""
    return Task(
        record["name"],
        CellModel(**record["cell"]),
        ParameterSpace(tuple(decode_parameter(parameter) for parameter in record["space"])),
        tuple(
            Experiment(
                experiment["name"],
                decode_trajectory(experiment["target"]),
                None if experiment["protocol"] is None else tuple(tuple(cycle) for cycle in experiment["protocol"]),
                experiment["scored_cycle"],
                experiment["temperature_k"],
                experiment["initial_soc"],
            )
            for experiment in record["experiments"]
        ),
        tuple(record["notes"]),
        domain=_decode_domain(record),
        signals=_decode_signals(record.get("signals", ())),
        simulator=record.get("simulator", ""),
    )


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
        "easing": None if trial.easing is None else asdict(trial.easing),
        "partial": None if trial.partial is None else encode_array(trial.partial),
    }


def decode_trial(record: Mapping[str, Any], folder: Path) -> Trial:
    """The inverse of `encode_trial`."""
    return Trial(
        index=record["index"],
        phase=record["phase"],
        round=record["round"],
        candidate=record["candidate"],
        metrics=decode_metrics(record["metrics"]),
        failure=None if record["failure"] is None else SimulationFailure(**record["failure"]),
        residuals=None if record["residuals"] is None else decode_array(record["residuals"]),
        feedback=Feedback(record["feedback"], tuple(folder / image for image in record["images"])),
        curves=tuple(None if curve is None else decode_trajectory(curve) for curve in record["curves"]),
        seconds=record["seconds"],
        # Journals of before tasks could be eased have neither.
        easing=None if record.get("easing") is None else Easing(**record["easing"]),
        partial=None if record.get("partial") is None else decode_array(record["partial"]),
    )


def encode_outcome(outcome: Outcome) -> Json:
    """What a simulation gave, whole."""
    runs = [
        {
            "trajectory": None if run.trajectory is None else encode_trajectory(run.trajectory),
            "failure": None if run.failure is None else asdict(run.failure),
        }
        for run in outcome.runs
    ]
    return {"runs": runs, "seconds": outcome.seconds}


def decode_outcome(record: Mapping[str, Any]) -> Outcome:
    """The inverse of `encode_outcome`."""
    runs = (
        ExperimentRun(
            None if run["trajectory"] is None else decode_trajectory(run["trajectory"]),
            None if run["failure"] is None else SimulationFailure(**run["failure"]),
        )
        for run in record["runs"]
    )
    return Outcome(tuple(runs), record["seconds"])


def encode_proposal(proposal: Proposal) -> Json:
    """A proposal; its candidates are in its trials, only their number is kept."""
    record = asdict(proposal)
    record["candidates"] = len(proposal.candidates)
    return record
