"""What the score sees, step by step: durations, the clock, each step's share of the misfit, residuals along it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...core.comparison.alignment import StepPair, pair_steps
from ...core.comparison.residuals import DURATION, StepMisfit, misfits
from ...core.prompt_sections import table
from ...core.signals import Signal, slug
from ...core.simulation import Outcome
from ...core.task import Experiment, Task
from ...core.trajectory import FloatArray, StepKind, Trajectory
from .ageing import told_cycles
from .features import FEW, are_fine, record_prefix
from .rounding import rounded

SAMPLES = (0.02, 0.07, 0.15, 0.3, 0.5, 0.7, 0.85, 0.93, 0.98)
"""Where residuals are told, as fractions of each step's own duration: closer where curves bend, at both ends."""

_WORTH_A_ROW = 5.0
"""Percent of the misfit above which residuals along a rest are told."""


def by_step(task: Task, outcome: Outcome) -> dict[str, Any]:
    """Two tables, ``steps`` and ``residuals_along_step``; empty where no step was reached."""
    found = misfits(task, outcome)
    total = sum(sum(step.squares.values()) for step in found) or 1.0
    clock, longest = _clock_offsets(found), _longest(task, found)
    told = [
        (name, step, offset)
        for name, step, offset in zip(_names(task, found), found, clock, strict=True)
        if step in longest
    ]
    if not told:
        return {}
    protocol = any(experiment.protocol is not None for experiment in task.experiments)
    fine = are_fine(task)
    columns = ["step", "measured_s", "curve_misfit_share_pct"]
    columns += ["simulated_s", "off_pct", "clock_offset_at_end_s", "duration_misfit_share_pct"] * protocol
    steps: list[list[Any]] = []
    along: list[list[Any]] = []
    for name, step, offset in told:
        shares = {key: round(float(f"{100.0 * value / total:.2g}"), 2) for key, value in step.squares.items()}
        duration = shares.pop(DURATION, None)
        measured_s, simulated_s = step.pair.duration_s
        off = round(100.0 * (simulated_s - measured_s) / measured_s, 3) if measured_s else None
        steps.append([name, measured_s, sum(shares.values()), *[simulated_s, off, offset, duration] * protocol])
        for signal in task.compared(step.pair.step.kind, step.experiment):
            rests = step.pair.step.kind is StepKind.REST
            # Fine parts are these residuals, as means.
            if not fine and not signal.oscillates and (not rests or shares[signal.name] > _WORTH_A_ROW):
                along.append([name, f"{signal.name}_{_unit(signal)}", *_along(step.pair, signal)])
    content = {"steps": table(columns, rounded(steps))}
    if along:
        heads = ["step", "signal", *(f"{100.0 * fraction:.0f} %" for fraction in SAMPLES)]
        content["residuals_along_step"] = table(heads, along)
    return content


def _names(task: Task, found: list[StepMisfit]) -> list[str]:
    """The steps' names as they begin the names of their features."""
    numbers = {id(experiment): number for number, experiment in enumerate(task.experiments, start=1)}
    return [record_prefix(task, numbers[id(step.experiment)]) + slug(step.pair.name) for step in found]


def named_steps(task: Task, simulated: Sequence[Trajectory | None]) -> dict[str, tuple[StepPair, Experiment]]:
    """The steps that say something, by the names that they have in the feedback."""
    found: dict[str, tuple[StepPair, Experiment]] = {}
    for number, (experiment, curve) in enumerate(zip(task.experiments, simulated, strict=True), start=1):
        for pair in pair_steps(curve, experiment):
            if pair.measured.duration >= task.domain.too_brief_s:
                found[record_prefix(task, number) + slug(pair.name)] = pair, experiment
    return found


def curves(pair: StepPair, signal: Signal, fractions: FloatArray) -> Mapping[str, FloatArray]:
    """A signal along a step at fractions of its own duration: measured, simulated, and the residual as it is told."""
    measured, simulated = pair.curves(signal, fractions)
    return {"measured": measured, "simulated": simulated, "residual": _residual(measured, simulated, signal)}


def _along(pair: StepPair, signal: Signal) -> list[float]:
    """Residuals at `SAMPLES`, to a hundredth of the tolerance."""
    tolerance = (100.0 if signal.relative else signal.shown_scale) * signal.tolerance
    decimals = 2 - math.floor(math.log10(tolerance))
    residual = curves(pair, signal, np.array(SAMPLES))["residual"]
    return rounded([round(float(value), decimals) for value in residual])  # type: ignore[no-any-return]


def _residual(measured: FloatArray, simulated: FloatArray, signal: Signal) -> FloatArray:
    """Simulated minus measured in the shown unit; of a relative signal in percent of the measured size."""
    if not signal.relative:
        return signal.shown_scale * (simulated - measured)
    return 100.0 * (np.abs(simulated) - np.abs(measured)) / np.maximum(np.abs(measured), 1e-12)


def _unit(signal: Signal) -> str:
    return "pct" if signal.relative else signal.suffix


def _longest(task: Task, found: list[StepMisfit]) -> list[StepMisfit]:
    """The steps that say something, or of many the longest."""
    lasting = [
        step
        for step in found
        if step.pair.measured.duration >= task.domain.too_brief_s
        and (not step.experiment.long or step.pair.step.cycle in told_cycles(step.experiment))
    ]
    return sorted(lasting, key=lambda step: -step.pair.measured.duration)[:FEW]


def _clock_offsets(found: list[StepMisfit]) -> list[float]:
    """How much later than measured each step ends in the simulation, from the start of the scored part, s.

    The cycles of a long record have a clock each.
    """
    offsets: list[float] = []
    before = None
    for step in found:
        clock = (id(step.experiment), step.pair.step.cycle if step.experiment.long else 0)
        late = 0.0 if clock != before else offsets[-1]
        measured_s, simulated_s = step.pair.duration_s
        offsets.append(late + simulated_s - measured_s)
        before = clock
    return offsets
