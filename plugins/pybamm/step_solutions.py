"""From PyBaMM's solution of an experiment to a trajectory with steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.trajectory import Step, StepKind, Trajectory
from .parameter_sets import pybamm


def step_kind(step: Any) -> StepKind:
    """What a PyBaMM experiment step does, from its control and its sign."""
    if isinstance(step, pybamm.step.Voltage):
        return StepKind.CV_HOLD
    if not isinstance(step.input_value, (int, float)):
        return StepKind.DRIVE
    if isinstance(step, pybamm.step.Resistance):
        return StepKind.CC_DISCHARGE
    if step.input_value == 0:
        return StepKind.REST
    return StepKind.CC_DISCHARGE if step.input_value > 0 else StepKind.CC_CHARGE


def to_trajectory(solution: Any, protocol_steps: Sequence[Sequence[Any]]) -> Trajectory | None:
    """Join the solved steps of an experiment.

    Parameters
    ----------
    solution : pybamm.Solution or None
        What the simulation reached.
    protocol_steps : sequence of sequence of pybamm steps
        The experiment's cycles, each with its steps.

    Returns
    -------
    Trajectory or None
        None if not one step was solved. A step that the protocol skips (its end was already reached)
        has no samples and does not appear; ``position`` tells which one is missing.
    """
    if solution is None or not getattr(solution, "cycles", None):
        return None
    times: list[np.ndarray] = []
    currents: list[np.ndarray] = []
    voltages: list[np.ndarray] = []
    temperatures: list[np.ndarray] = []
    steps: list[Step] = []
    count = 0
    for number, (cycle, recipe) in enumerate(zip(solution.cycles, protocol_steps, strict=False), start=1):
        if cycle is None:
            continue
        for position, (part, step) in enumerate(zip(cycle.steps, recipe, strict=False)):
            if isinstance(part, pybamm.EmptySolution):
                continue
            times.append(np.asarray(part.t))
            currents.append(part["Current [A]"].entries)
            voltages.append(part["Voltage [V]"].entries)
            temperatures.append(part["Volume-averaged cell temperature [K]"].entries)
            steps.append(Step(step_kind(step), count, count + len(part.t), number, str(step), position))
            count += len(part.t)
    if not steps:
        return None
    # A step starts an instant after the last one ends; the stamps may differ by rounding only.
    time = np.maximum.accumulate(np.concatenate(times))
    return Trajectory(
        time - time[0], np.concatenate(currents), np.concatenate(voltages), np.concatenate(temperatures), tuple(steps)
    )
