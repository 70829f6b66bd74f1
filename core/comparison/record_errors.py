"""Errors of one record, signal by signal: whole, without its worst hundredth, and step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..ageing.fade_band import CAPACITY
from ..cell import TEMPERATURE
from ..rms import rms
from ..shape import shaped
from ..signals import Signal
from ..simulation import ExperimentRun, Outcome, SimulationFailure
from ..spectrum import SpectrumErrors, compare
from ..task import Experiment, Task
from ..trajectory import FloatArray, Trajectory
from .alignment import StepPair, pair_steps
from .overlap import differences, rms_without_worst, scored_part, time_weights, weighted_rms
from .spectrum_record import recorded_spectrum

_PER_STEP = 200
"""Points at which a step of a protocol is compared, each curve on its own clock."""


@dataclass(frozen=True)
class SignalError:
    """How far one signal is off, in its shown unit (mV for a voltage)."""

    unit: str  # The shown unit.
    rms: float  # Root mean square over time.
    max: float  # Largest absolute error; steps of a single sample, which stand at a jump of the current, do not count.
    rms_99: float  # Root mean square over the 99 % of the time in which the error is smallest.


@dataclass(frozen=True)
class StepErrors:
    """Errors of one step."""

    name: str  # ``"CC discharge"``, numbered where a kind occurs more than once.
    # start_s, duration_s: On the record's clock, s.
    start_s: float
    duration_s: float
    signals: Mapping[str, SignalError]  # By signal.


@dataclass(frozen=True)
class RecordErrors:
    """Errors of one record. JSON-ready through `as_json`."""

    record: str  # The record's name. Untrusted.
    signals: Mapping[str, SignalError]  # Of the whole record, by signal; empty where nothing was simulated.
    steps: tuple[StepErrors, ...] = ()  # Step by step, as far as the simulation got.
    failure: str = ""  # Why the simulation ended early; the errors are then those of the part that it reached.
    limits: tuple[str, ...] = ()  # See `ExperimentRun.limits`: such a fit is no good, however small its errors.
    impedance: SpectrumErrors | None = None  # Of a spectrum the resistances that it shows.

    def as_json(self) -> dict[str, Any]:
        """Plain dicts, lists, strings and numbers."""
        content = asdict(self)
        if self.impedance is None:
            del content["impedance"]
        return {**content, "steps": list(content["steps"]), "limits": list(content["limits"])}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> RecordErrors:
        """The inverse of `as_json`. Raises `ValueError` if the content is of another shape."""
        found: RecordErrors = shaped(cls, content)
        return found


def errors_by_record(task: Task, outcome: Outcome) -> tuple[RecordErrors, ...]:
    """The errors of every record of a task."""
    return tuple(
        errors_of_record(task, experiment, run) for experiment, run in zip(task.experiments, outcome.runs, strict=True)
    )


def misfits(records: Sequence[RecordErrors]) -> dict[str, float]:
    """By signal the root mean square of the errors of several records, each of the same weight, in the shown unit."""
    errors: dict[str, list[float]] = {}
    for record in records:
        for name, error in record.signals.items():
            errors.setdefault(name, []).append(error.rms)
    return {name: rms(np.array(values)) for name, values in errors.items()}


def errors_of_record(task: Task, experiment: Experiment, run: ExperimentRun) -> RecordErrors:
    """The errors of one record. Of a simulation that is whole or was cut short."""
    failure = "" if run.failure is None else _why(run.failure, experiment)
    simulated = scored_part(run.trajectory, experiment)
    if simulated is None or run.trajectory is None:
        return RecordErrors(experiment.name, {}, failure=failure or "the scored part was not reached")
    target, driven = experiment.scored_target, experiment.protocol is None
    signals = [*task.observed_in(target)]
    if all(TEMPERATURE.name in curve.signals for curve in (target, simulated)):
        signals += [TEMPERATURE] * (TEMPERATURE.name not in {signal.name for signal in signals})
    pairs = pair_steps(run.trajectory, experiment)
    if experiment.long:
        whole = {signal.name: _over_steps(signal, pairs) for signal in signals} | _of_capacity(run, target)
    else:
        whole = {signal.name: _over_time(signal, simulated, target, driven) for signal in signals}
    if experiment.is_spectrum:
        spectra = (recorded_spectrum(experiment.name, record) for record in (target, simulated))
        return RecordErrors(experiment.name, whole, failure=failure, impedance=compare(*spectra))
    steps = []
    for pair in pairs:
        if pair.simulated is None or len(pair.measured) < 2:
            continue
        if driven:
            found = {signal.name: _over_time(signal, pair.simulated, pair.measured, driven) for signal in signals}
        else:
            found = {signal.name: _error(signal, np.ones(_PER_STEP), _aligned(signal, pair)) for signal in signals}
        steps.append(StepErrors(pair.name, float(pair.measured.time[0]), pair.measured.duration, found))
    return RecordErrors(experiment.name, whole, tuple(steps), failure, run.limits)


def _why(failure: SimulationFailure, experiment: Experiment) -> str:
    if experiment.long:
        return f"{failure.cause}, in cycle {failure.cycle} of {len(experiment.protocol or ())}"
    if experiment.is_spectrum:
        return failure.cause
    return f"{failure.cause}, after {failure.reached_s:.0f} of {experiment.target.duration:.0f} s"


def _over_time(signal: Signal, simulated: Trajectory, target: Trajectory, driven: bool) -> SignalError:
    time, difference = differences(simulated, target, signal.name, driven)
    lone = _lone_samples(target, len(time)) if driven else []
    judged = np.delete(difference, lone) if len(lone) < len(time) else difference
    return replace(_error(signal, time_weights(time), difference), max=float(signal.shown_scale * np.abs(judged).max()))


def _lone_samples(target: Trajectory, compared: int) -> list[int]:
    """Places of lone samples among those that were taken, of which so many are compared.

    Such a sample stands at a jump of the current, where a simulation may show the one side or the other.
    """
    taken = ~target.inserted
    places = np.cumsum(taken) - 1
    starts = [step.start for step in target.steps if step.stop - step.start == 1 and taken[step.start]]
    return [int(places[start]) for start in starts if places[start] < compared]


def _aligned(signal: Signal, pair: StepPair) -> FloatArray:
    """Simulated minus measured at `_PER_STEP` points of a step, each curve on its own clock."""
    measured, simulated = pair.curves(signal, (np.arange(_PER_STEP) + 0.5) / _PER_STEP)
    return np.asarray(simulated - measured)


def _over_steps(signal: Signal, pairs: Sequence[StepPair]) -> SignalError:
    """The error over all steps of a long record, whose cycles have a clock of their own each."""
    reached = [pair for pair in pairs if pair.simulated is not None and len(pair.measured) > 1] or pairs[:1]
    weight = np.concatenate([np.full(_PER_STEP, max(pair.measured.duration, 1e-3)) for pair in reached])
    return _error(signal, weight, np.concatenate([_aligned(signal, pair) for pair in reached]))


def _of_capacity(run: ExperimentRun, target: Trajectory) -> dict[str, SignalError]:
    """The error of the capacity of each cycle that was simulated, in percent of the first one."""
    ours, theirs = None if run.trajectory is None else run.trajectory.cycle_table, target.cycle_table
    if ours is None or theirs is None:
        return {}
    simulated_ah = (ours.delivered_ah if run.failure is None else ours.at)(theirs.cycle)
    off = 100.0 * (simulated_ah - theirs.capacity_ah) / theirs.capacity_ah[0]
    size = np.abs(off[np.isfinite(off)])
    if not len(size):
        return {}
    weight = np.ones(len(size))
    return {CAPACITY: SignalError("%", weighted_rms(weight, size), float(size.max()), rms_without_worst(weight, size))}


def _error(signal: Signal, weight: FloatArray, difference: FloatArray) -> SignalError:
    size = signal.shown_scale * np.abs(difference)
    return SignalError(signal.shown, weighted_rms(weight, size), float(size.max()), rms_without_worst(weight, size))
