"""What a simulation of a long record shows: its fade beside the measured one, and the cycles that matter most."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.ageing.choice import knee, levelling, shown_cycles
from ...core.ageing.cycle_table import CycleTable
from ...core.ageing.residuals import CAPACITY_TOLERANCE, RESISTANCE_TOLERANCE
from ...core.comparison.alignment import StepPair, pair_steps
from ...core.simulation import ExperimentRun
from ...core.task import Experiment, Task
from ...core.thinning import evenly
from ...core.trajectory import FloatArray, StepKind, Trajectory

_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of a life at which capacity and resistance are told, whatever its length."""

_CURVE_POINTS = 10
"""Points at which the fade is drawn in words."""


def told_cycles(experiment: Experiment) -> tuple[int, ...]:
    """The detailed cycles whose steps become features: first, last, and where the measured fade bends.

    They depend on the record alone, so that a feature means the same in every trial.
    """
    kept, table = experiment.detailed_cycles, experiment.target.cycle_table
    bend = None if table is None else knee(table) or levelling(table)
    between = kept[len(kept) // 2] if bend is None else min(kept, key=lambda cycle: abs(cycle - bend))
    return tuple(sorted({kept[0], between, kept[-1]}))


def fade_features(run: ExperimentRun, experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Mismatches of capacity and resistance over life in percent, simulated minus measured, and their tolerances.

    Names end in the cycle and the unit: ``capacity_mismatch_cycle_200_pct``. ``fade_mismatch_pct`` is the simulated
    capacity lost from first to last cycle minus the measured one, in percent of the first capacity.
    """
    measured, simulated = experiment.target.cycle_table, None if run.trajectory is None else run.trajectory.cycle_table
    if measured is None or simulated is None:
        return {}
    found: dict[str, tuple[float, float]] = {}
    tolerances = {"capacity": 100.0 * CAPACITY_TOLERANCE, "resistance": 100.0 * RESISTANCE_TOLERANCE}
    # Of a simulation that stopped early nothing is known of the later cycles.
    capacity = simulated.delivered_ah if run.failure is None else simulated.at
    cycles, ends = np.array(_spread(measured)), measured.cycle[[0, -1]]
    compared = {
        "capacity": (capacity(cycles), measured.at(cycles)),
        "resistance": (simulated.at(cycles, "resistance_ohm"), measured.at(cycles, "resistance_ohm")),
    }
    for told, (ours, theirs) in compared.items():
        for cycle, mismatch in zip(cycles, 100.0 * (ours / theirs - 1.0), strict=True):
            found[f"{told}_mismatch_cycle_{cycle:.0f}_pct"] = float(mismatch), tolerances[told]
    lost = [float(-np.diff(ah)[0]) for ah in (capacity(ends), measured.at(ends))]
    found["fade_mismatch_pct"] = 100.0 * (lost[0] - lost[1]) / float(measured.capacity_ah[0]), tolerances["capacity"]
    return {name: pair for name, pair in found.items() if np.isfinite(pair[0])}


def _spread(table: CycleTable) -> list[float]:
    places = {round(share * (len(table) - 1)) for share in _SHARES}
    return [float(table.cycle[place]) for place in sorted(places)]


def measured_life(experiment: Experiment) -> dict[str, Any]:
    """The record in a few numbers: capacity and resistance over life, where the fade bends, which curves are known."""
    table = experiment.target.cycle_table
    assert table is not None
    content = {"cycles": len(experiment.protocol or ()), **_curve(table, table)}
    bends = {"knee_at_cycle": knee(table), "levels_off_at_cycle": levelling(table)}
    content |= {name: cycle for name, cycle in bends.items() if cycle is not None}
    return {**content, "cycles_with_curves": list(experiment.detailed_cycles)}


def _curve(table: CycleTable, measured: CycleTable) -> dict[str, Any]:
    cycles = measured.cycle[evenly(len(measured), _CURVE_POINTS)]
    content: dict[str, Any] = {"at_cycles": [int(cycle) for cycle in cycles]}
    for column in ("capacity_ah", "resistance_ohm", "rested_voltage_v"):
        values = table.at(cycles, column)
        if np.all(np.isfinite(values)):
            content[column] = [float(f"{value:.5g}") for value in values]
    return content


def cycles_in_detail(
    task: Task, curves: Sequence[Trajectory | None], asked: Sequence[int] = ()
) -> list[dict[str, Any]]:
    """The simulated fade, and the steps of the cycles that matter most in a trial, for each record.

    ``curves`` are what was simulated of each record, or a thinned copy of it; ``asked`` the cycles that the proposer
    asked for. JSON-ready, of the same size for any number of cycles.
    """
    found = []
    for experiment, curve in zip(task.experiments, curves, strict=True):
        measured = experiment.target.cycle_table
        assert measured is not None
        simulated = None if curve is None else curve.cycle_table
        content: dict[str, Any] = {} if simulated is None else {"simulated": _curve(simulated, measured)}
        pairs = pair_steps(curve, experiment)
        shown = shown_cycles(experiment.detailed_cycles, measured, simulated, asked)
        content["cycles"] = [
            {
                "cycle": cycle,
                "shown_because": reason,
                "steps": _steps([p for p in pairs if p.step.cycle == cycle], task),
            }
            for cycle, reason in shown.items()
        ]
        found.append(content)
    return found


def _steps(pairs: Sequence[StepPair], task: Task) -> list[dict[str, Any]]:
    """Duration and mean voltage of each step, measured and simulated."""
    rows = []
    for pair in pairs:
        if pair.measured.duration < task.domain.too_brief_s or not pair.reached:
            continue
        measured_s, simulated_s = pair.duration_s
        row: dict[str, Any] = {"step": str(pair.step.kind), "measured_s": measured_s, "simulated_s": simulated_s}
        if pair.step.kind is not StepKind.CV_HOLD and pair.simulated is not None:
            row["voltage_shift_mv"] = 1e3 * float(np.mean(_shifts(pair, task)))
        rows.append(row)
    return rows


def _shifts(pair: StepPair, task: Task) -> FloatArray:
    [voltage] = [signal for signal in task.signals if signal.name == "voltage"]
    measured, simulated = pair.curves(voltage, np.linspace(0.05, 0.95, 10))
    return simulated - measured
