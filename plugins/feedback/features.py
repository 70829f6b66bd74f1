"""Features a person would read off an overlay: how long each step took, and where its curve lies."""

from __future__ import annotations

import numpy as np

from ...core.alignment import StepPair, pair_steps
from ...core.simulation import Outcome
from ...core.task import Task
from ...core.trajectory import StepKind

_PARTS = {"early": (0.05, 0.25), "middle": (0.40, 0.60), "late": (0.75, 0.95)}
_FEW = 12
"""Steps described in detail; of longer records the longest steps stand for all."""

_SHORTEST_S = 20.0
"""Steps shorter than this (the one-second rests of the paper's protocol) say nothing of their own."""


def features(task: Task, outcome: Outcome) -> dict[str, float]:
    """Signed mismatches, simulated minus measured, by name.

    Names end in their unit: ``cc_charge_time_mismatch_s``, ``cc_discharge_middle_shift_mv``,
    ``cv_hold_middle_current_shift_pct``. The names depend on the task alone, except that steps a failed
    simulation never reached are missing.

    Returns
    -------
    dict of str to float
    """
    result: dict[str, float] = {}
    for number, (experiment, run) in enumerate(zip(task.experiments, outcome.runs, strict=True), start=1):
        prefix = f"record_{number}_" if len(task.experiments) > 1 else ""
        pairs = [pair for pair in pair_steps(run.trajectory, experiment) if pair.measured.duration >= _SHORTEST_S]
        longest = sorted(pairs, key=lambda pair: -pair.measured.duration)[:_FEW]
        # The last step of a failed simulation is cut short, and its duration says nothing.
        reached = [pair for pair in pairs if pair in longest and (pair.simulated is not None or run.failure is None)]
        for place, pair in enumerate(reached):
            truncated = run.failure is not None and place == len(reached) - 1
            if not truncated:
                driven = experiment.protocol is None
                result.update(_step_features(prefix + _slug(pair.name), pair, driven))
    return result


def _step_features(name: str, pair: StepPair, driven: bool) -> dict[str, float]:
    result: dict[str, float] = {}
    if not driven and pair.step.kind is not StepKind.REST:
        measured_s, simulated_s = pair.duration_s
        result[f"{name}_time_mismatch_s"] = simulated_s - measured_s
    holding = pair.step.kind is StepKind.CV_HOLD and not driven
    for part, (begin, end) in _PARTS.items():
        fractions = np.linspace(begin, end, 9)
        if holding:
            measured, simulated = pair.current(fractions)
            scale = float(np.mean(np.abs(measured))) or 1.0
            result[f"{name}_{part}_current_shift_pct"] = (
                100.0 * float(np.mean(np.abs(simulated) - np.abs(measured))) / scale
            )
        elif pair.step.kind is not StepKind.REST or part == "late":
            measured, simulated = pair.voltage(fractions)
            result[f"{name}_{part}_shift_mv"] = 1e3 * float(np.mean(simulated - measured))
    return {key: value for key, value in result.items() if np.isfinite(value)}


def _slug(name: str) -> str:
    return name.lower().replace(" ", "_")
