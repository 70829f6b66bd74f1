"""How well a simulation of a long record matches it: cycle by cycle on each cycle's own clock, and the fade."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..comparison.overlap import overlap_rms
from ..comparison.paper_metrics import PaperMetrics, curve_errors, step_duration_error
from ..comparison.signal_metrics import Quantity
from ..printable import counted
from ..simulation import Outcome
from ..task import Experiment, Task
from ..trajectory import Trajectory
from .summary import discharged_ah


@dataclass(frozen=True)
class AgeingMetrics(PaperMetrics):
    """Errors of one trial on long records, averaged over them.

    The errors of `PaperMetrics` are means over the detailed cycles, each compared from its own start; the charge of a
    cycle is that drawn in its discharge.
    """

    # Mean over all cycles of the record of the capacity mismatch, in percent of the first cycle's capacity.
    fade_error: float = 0.0
    # Mean of the resistance mismatch over the cycles whose resistance is known, in percent; 0 where none is.
    resistance_error: float = 0.0


FADE = Quantity("fade_error", "Capacity error over all cycles", "%", told="fade_error_pct_of_first_capacity")
RESISTANCE = Quantity("resistance_error", "Resistance error over all cycles", "%", told="resistance_error_pct")


def over_cycles(quantities: Iterable[Quantity], task: Task) -> tuple[Quantity, ...]:
    """Errors of curves under names that say over what: at equal times from the start of each detailed cycle.

    Beside them stand errors of all cycles, and record by record those step by step, for which a step that ends early is
    stretched to its measured duration.
    """
    count = sum(len(experiment.detailed_cycles) for experiment in task.experiments)
    cycles = counted(count, "cycle")
    labels = {"v_rmse_mv": f"Voltage RMSE at equal times of {cycles}", "capacity_error": f"Capacity error of {cycles}"}
    return tuple(replace(one, label=labels.get(one.key, one.label)) for one in quantities)


def of_tables(task: Task) -> tuple[Quantity, ...]:
    """Errors of the capacities and, where any is known, of the resistances of a life, named for their cycles.

    A resistance is known where the record has samples right behind a switch of the current: often of few cycles.
    """
    tables = [experiment.target.cycle_table for experiment in task.experiments]
    known = [np.isfinite(table.resistance_ohm) for table in tables if table is not None]
    count, of_all = sum(int(np.sum(one)) for one in known), sum(map(len, known))
    if not count:
        return (FADE,)
    return FADE, RESISTANCE if count == of_all else replace(
        RESISTANCE, label=f"Resistance error of {counted(count, 'cycle')}"
    )


def evaluate(task: Task, outcome: Outcome) -> AgeingMetrics | None:
    """Compare an outcome with the task's long records; None if a simulation did not reach the end of one."""
    rows = [_compare(run.trajectory, e) for e, run in zip(task.experiments, outcome.runs, strict=True)]
    if not outcome.ok or any(row is None for row in rows):
        return None
    names = AgeingMetrics.__dataclass_fields__
    found = {name: float(np.mean([getattr(row, name) for row in rows])) for name in names}
    found["v_rmse_mv"] = float(np.sqrt(np.mean([row.v_rmse_mv**2 for row in rows if row is not None])))
    return AgeingMetrics(**found)


def _compare(simulated: Trajectory | None, experiment: Experiment) -> AgeingMetrics | None:
    target = experiment.target
    if simulated is None or simulated.cycle_table is None or target.cycle_table is None:
        return None
    if not set(experiment.detailed_cycles) <= set(simulated.cycles):
        return None
    pairs = [(simulated.cycle(number), target.cycle(number)) for number in experiment.detailed_cycles]
    charges = np.array([(discharged_ah(ours), discharged_ah(theirs)) for ours, theirs in pairs])
    charges = charges[charges[:, 1] > 0]
    capacity_error = float(np.mean(np.abs(charges[:, 0] / charges[:, 1] - 1.0))) if len(charges) else 0.0
    current = np.mean([curve_errors(ours, theirs, "current") for ours, theirs in pairs], axis=0)
    voltage = np.mean([curve_errors(ours, theirs, "voltage") for ours, theirs in pairs], axis=0)
    charge_rmse = float(np.mean(np.abs(charges[:, 0] - charges[:, 1]))) if len(charges) else 0.0
    mape = 100.0 * capacity_error + float(current[0] + voltage[0])
    squares = [overlap_rms(ours, theirs, "voltage", driven=False) ** 2 for ours, theirs in pairs]
    measured = target.cycle_table
    delivered = simulated.cycle_table.delivered_ah(measured.cycle)
    fade = np.abs(delivered - measured.capacity_ah) / measured.capacity_ah[0]
    resistance = simulated.cycle_table.at(measured.cycle, "resistance_ohm") / measured.resistance_ohm - 1.0
    return AgeingMetrics(
        objective=mape,
        mape=mape,
        q_mape=100.0 * capacity_error,
        i_mape=float(current[0]),
        v_mape=float(voltage[0]),
        rmse=charge_rmse + float(current[1] + voltage[1]),
        v_rmse_mv=1e3 * float(np.sqrt(np.mean(squares))),
        step_duration_error=step_duration_error(simulated, experiment),
        capacity_error=capacity_error,
        fade_error=100.0 * float(np.mean(fade)),
        resistance_error=_mean_pct(resistance),
    )


def _mean_pct(shares: np.ndarray) -> float:
    known = np.abs(shares[np.isfinite(shares)])
    return 100.0 * float(np.mean(known)) if len(known) else 0.0
