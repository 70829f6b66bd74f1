"""Features a person would read off an overlay: how long each step took, and where its curve lies."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...core.comparison.alignment import StepPair, pair_steps
from ...core.comparison.residuals import DURATION_TOLERANCE, POINTS, tolerance_at
from ...core.rms import rms
from ...core.signals import Signal, slug
from ...core.simulation import Outcome
from ...core.task import Experiment, Task
from ...core.trajectory import FloatArray, StepKind
from .ageing import fade_features, told_cycles

_PARTS = {"early": (0.05, 0.25), "middle": (0.40, 0.60), "late": (0.75, 0.95)}

_EDGES = (0.0, 0.04, 0.10, 0.20, 0.40, 0.60, 0.80, 0.90, 0.96, 1.0)
_FINE_PARTS = {f"at_{50.0 * (begin + end):.0f}_pct": (begin, end) for begin, end in pairwise(_EDGES)}
"""Parts of a measured current's steps where they are few: three levels of one discharge cannot tell twenty parameters
apart. Narrow at both ends, where voltage curves bend."""

_FEW_STEPS = 2
"""With more steps than this three parts of each give as many features as fine parts of these."""

_POINTS, _SWING_POINTS = 9, 100
"""Points of a part of a step by which a level is judged, and a swing of some ten periods."""


def _as_one(parts: int) -> float:
    """Share of a signal's tolerance by which one part of a step must lie off to weigh as one tolerance of a duration.

    In the misfit a part stands for its share of the step's points.
    """
    return math.sqrt(parts / POINTS)


FEW = 12
"""Steps described in detail; of longer records the longest steps stand for all."""


@dataclass(frozen=True)
class Mismatch:
    """A feature's value, simulated minus measured, and the size that counts as one."""

    value: float
    tolerance: float


def mismatches(task: Task, outcome: Outcome) -> dict[str, Mismatch]:
    """Signed mismatches, simulated minus measured, by name.

    Names end in their unit: ``cc_charge_time_mismatch_s``, ``cc_discharge_middle_shift_mv``,
    ``cv_hold_middle_current_shift_pct``. Where several signals are observed, their names stand in between:
    ``free_decay_late_displacement_shift_mm``. Where `are_fine` the parts of a step are nine:
    ``cc_discharge_at_30_pct_shift_mv``. A signal that oscillates has, for a shift, the mismatch of its amplitude and
    its delay: ``..._amplitude_shift_mm``, ``..._lag_s``, positive where the simulation is late. The names depend on the
    task alone, except that steps a failed simulation never reached are missing. Tolerances are those of the residuals,
    so that each feature weighs as it does in the misfit.
    """
    result: dict[str, Mismatch] = {}
    parts = _FINE_PARTS if are_fine(task) else _PARTS
    for number, (experiment, run) in enumerate(zip(task.experiments, outcome.runs, strict=True), start=1):
        prefix = record_prefix(task, number)
        found = pair_steps(run.trajectory, experiment)
        if experiment.long:
            found = [pair for pair in found if pair.step.cycle in told_cycles(experiment)]
            result.update({prefix + name: Mismatch(*pair) for name, pair in fade_features(run, experiment).items()})
        # The one-second rests of the paper's protocol say nothing of their own.
        pairs = [pair for pair in found if pair.measured.duration >= task.domain.too_brief_s]
        longest = sorted(pairs, key=lambda pair: -pair.measured.duration)[:FEW]
        reached = [pair for pair in pairs if pair in longest and (pair.simulated is not None or run.failure is None)]
        if run.failure is not None:
            # The last step of a failed simulation is cut short, and its duration says nothing.
            reached = reached[:-1]
        for pair in reached:
            result.update(_step_features(prefix + slug(pair.name), pair, task, experiment, parts))
    return result


def are_fine(task: Task) -> bool:
    """Whether steps are told in fine parts: those of measured currents, where all records together have few.

    Not where a signal oscillates: a part must hold whole swings.
    """
    by_protocol = any(experiment.protocol is not None for experiment in task.experiments)
    if by_protocol or any(signal.oscillates for signal in task.observed):
        return False
    measured = [pair.measured for experiment in task.experiments for pair in pair_steps(None, experiment)]
    return 0 < sum(piece.duration >= task.domain.too_brief_s for piece in measured) <= _FEW_STEPS


def record_prefix(task: Task, number: int) -> str:
    """What stands before the names of one record's steps; nothing where there is but one record."""
    return f"record_{number}_" if len(task.experiments) > 1 else ""


def _step_features(
    name: str, pair: StepPair, task: Task, experiment: Experiment, parts: Mapping[str, tuple[float, float]]
) -> dict[str, Mismatch]:
    result: dict[str, Mismatch] = {}
    rests = pair.step.kind is StepKind.REST
    if experiment.protocol is not None and not rests:
        measured_s, simulated_s = pair.duration_s
        result[f"{name}_time_mismatch_s"] = Mismatch(simulated_s - measured_s, DURATION_TOLERANCE * measured_s)
    for part, (begin, end) in parts.items():
        if rests and parts is _PARTS and part != "late":
            continue
        for signal in task.compared(pair.step.kind, experiment):
            found = _signal_features(f"{name}_{part}", pair, signal, task, experiment, begin, end)
            as_one = 1.0 if signal.oscillates else _as_one(len(parts))
            result |= {key: Mismatch(one.value, as_one * one.tolerance) for key, one in found.items()}
    return {key: found for key, found in result.items() if np.isfinite(found.value)}


def _signal_features(
    name: str, pair: StepPair, signal: Signal, task: Task, experiment: Experiment, begin: float, end: float
) -> dict[str, Mismatch]:
    if signal.oscillates:
        return _swing_features(f"{name}_{signal.name}", pair, signal, begin, end)
    measured, simulated = pair.curves(signal, np.linspace(begin, end, _POINTS))
    if signal.relative:
        scale = float(np.mean(np.abs(measured))) or 1.0
        shift = 100.0 * float(np.mean(np.abs(simulated) - np.abs(measured))) / scale
        tolerance = 100.0 * tolerance_at(signal, scale, experiment) / scale
        return {f"{name}_{signal.name}_shift_pct": Mismatch(shift, tolerance)}
    shift = signal.shown_scale * float(np.mean(simulated - measured))
    # A single observed signal goes without saying.
    subject = "" if task.observed == (signal,) else f"{signal.name}_"
    return {f"{name}_{subject}shift_{signal.suffix}": Mismatch(shift, signal.shown_scale * signal.tolerance)}


def _swing_features(name: str, pair: StepPair, signal: Signal, begin: float, end: float) -> dict[str, Mismatch]:
    """How much larger a signal swings than the measured one, and how much later; smooth where both are small."""
    fractions = np.linspace(begin, end, _SWING_POINTS)
    measured, simulated = pair.curves(signal, fractions)
    rate = np.gradient(measured, fractions * (pair.measured.duration or 1.0))
    moved = float(rate @ rate)
    # A curve that comes late by a short time lies off by that time times the slope.
    lag_s = float(rate @ (measured - simulated)) / moved if moved > 0 else 0.0
    larger = signal.shown_scale * (_amplitude(simulated) - _amplitude(measured))
    slope = rms(rate)
    found = {f"{name}_amplitude_shift_{signal.suffix}": Mismatch(larger, signal.shown_scale * signal.tolerance)}
    if slope > 0:
        found[f"{name}_lag_s"] = Mismatch(lag_s, signal.tolerance / slope)
    return found


def _amplitude(values: FloatArray) -> float:
    """Of the sine with the same root mean square about its mean."""
    return float(np.sqrt(2.0) * np.std(values))
