"""From PyBaMM's solution of an experiment to a trajectory with steps."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ....core.trajectory import FloatArray, Step, StepKind, Trajectory
from ..cells.parameter_sets import pybamm

_FIRST_SAMPLE_S, _SAMPLE_GROWTH, _LONGEST_SAMPLE_S = 0.1, 1.15, 30.0
"""Sampling of a voltage hold, whose current falls fastest at its start: every 30 s would miss 1 % of its charge."""

Part = tuple[int, int, Any]
"""What was solved of a step: its cycle, from 1, its place in the cycle, from 0, and PyBaMM's solution."""

_CURRENT, _VOLTAGE, _TEMPERATURE = "Current [A]", "Voltage [V]", "Volume-averaged cell temperature [K]"


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


def keep_solver_steps_of_holds(experiment: Any) -> None:
    """Let the solver keep its own steps during voltage holds, so that they can be sampled at any time."""
    for step in experiment.steps:
        if isinstance(step, pybamm.step.Voltage):
            step.period = None


def _times_of_hold(stored: FloatArray) -> FloatArray:
    """When a solved voltage hold is sampled: the same times after its start for every candidate, and its end."""
    duration = stored[-1] - stored[0]
    offsets = [0.0]
    spacing = _FIRST_SAMPLE_S
    while offsets[-1] + spacing < duration:
        offsets.append(offsets[-1] + spacing)
        spacing = min(spacing * _SAMPLE_GROWTH, _LONGEST_SAMPLE_S)
    # The end itself, not start + duration: a rounding beyond it cannot be interpolated.
    return np.append(stored[0] + np.array(offsets), stored[-1])


def to_trajectory(
    solved: Iterable[Part],
    protocol_steps: Sequence[Sequence[Any]],
    with_temperature: bool,
    unfinished: Part | None = None,
) -> Trajectory | None:
    """Join the solved steps of an experiment; None if not one step was solved.

    ``protocol_steps`` are the experiment's cycles, each with its steps. A step that the protocol skips (its end was
    already reached) has no samples and does not appear; ``position`` tells which one is missing. The temperature of an
    isothermal cell says nothing, and reading a variable costs a few per cent of a solve. ``unfinished``, the beginning
    of the step in which a simulation died, comes last.
    """
    parts = [part for part in solved if not isinstance(part[-1], pybamm.EmptySolution)]
    if not parts:
        return None
    whole = len(parts)
    if unfinished is not None:
        parts.append(unfinished)
    times: list[FloatArray] = []
    signals: dict[str, list[FloatArray]] = {_CURRENT: [], _VOLTAGE: []}
    if with_temperature:
        signals[_TEMPERATURE] = []
    steps: list[Step] = []
    count = 0
    for number, position, part in parts:
        step, time = protocol_steps[number - 1][position], np.asarray(part.t)
        kind = step_kind(step)
        held = kind is StepKind.CV_HOLD and len(steps) < whole
        if held:
            time = _times_of_hold(time)
        times.append(time)
        for name, signal in signals.items():
            signal.append(part[name](time) if held else part[name].entries)
        steps.append(Step(kind, count, count + len(time), number, str(step), position))
        count += len(time)
    # A step starts an instant after the last one ends; the stamps may differ by rounding only.
    stamps = np.maximum.accumulate(np.concatenate(times))
    joined = {name: np.concatenate(signal) for name, signal in signals.items()}
    return Trajectory(stamps - stamps[0], joined[_CURRENT], joined[_VOLTAGE], joined.get(_TEMPERATURE), tuple(steps))
