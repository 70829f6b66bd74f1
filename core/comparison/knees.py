"""How far residuals are off where a record is steep: by its clock, and by the charge that was counted.

At the end of a discharge a cell loses a volt within a percent of its charge. There the distance between two curves
tells an error of the time or of the charge many times over, and such an error is no property of the cell.
"""

from collections.abc import Callable

import numpy as np

from ..cell import CURRENT
from ..simulation import ExperimentRun, Outcome
from ..task import Experiment, Task
from ..trajectory import SECONDS_PER_HOUR, FloatArray, StepKind, Trajectory
from .residuals import residuals, rows_of

CLOCK_SHARE = 0.05
"""Share of the sampling interval by which the clock of a sample may be off."""

CHARGE_SHARE = 0.002
"""Share of the charge drawn by which charge is uncertain; it blurs the voltage where that falls steeply."""

USUAL_SLOPE = 3.0
"""What an error of the charge moves up to so many times the median of a record is no knee: it is as on its slope."""

_OF_STEP = 0.02
"""Share of the charge of a step so far by which it is off at most: its first samples fall for another reason."""

_Late = Callable[[Trajectory], FloatArray]
"""By how much each sample of a record may be late, s; shape (n,)."""


def knees_of_residuals(task: Task) -> FloatArray:
    """Standard deviations that clock and charge of the records give the residuals, in tolerances, shape (m,).

    Nothing where a protocol is simulated, whose steps end by themselves, nor of spectra and tables of cycles.
    """
    record = rows_of(task).record
    clock, charge = _moved(task, _by_clock), _moved(task, _by_charge)
    for place in np.unique(record):
        moves = charge[record == place]
        usual = float(np.median(moves[moves > 0.0])) if np.any(moves > 0.0) else 0.0
        charge[record == place] = np.maximum(moves - USUAL_SLOPE * usual, 0.0)
    return np.hypot(clock, charge)


def _moved(task: Task, late: _Late) -> FloatArray:
    """Sizes of the residuals of a simulation that equals the records, but later."""
    runs = [ExperimentRun(_later(e.target, late) if _is_driven(e) else e.target) for e in task.experiments]
    found = residuals(task, Outcome(tuple(runs)))
    return np.zeros(len(rows_of(task).record)) if found is None else np.abs(found)


def _is_driven(experiment: Experiment) -> bool:
    return experiment.protocol is None and not experiment.is_spectrum


def _by_clock(record: Trajectory) -> FloatArray:
    return CLOCK_SHARE * np.gradient(record.time) if len(record) > 1 else np.zeros(len(record))


def _by_charge(record: Trajectory) -> FloatArray:
    late = np.zeros(len(record))
    if CURRENT.name not in record.signals:
        return late
    charge_as = CHARGE_SHARE * SECONDS_PER_HOUR * float(np.ptp(record.discharge_capacity))
    for step in record.steps:
        here = slice(step.start, step.stop)
        size = np.abs(record.current[here])
        # A varying current moves the voltage by itself.
        if step.kind not in (StepKind.REST, StepKind.DRIVE) and np.all(size > 0.0):
            so_far = record.time[here] - record.time[step.start]
            late[here] = np.minimum(charge_as / size, _OF_STEP * so_far)
    return late


def _later(record: Trajectory, late: _Late) -> Trajectory:
    """The same record with signals that come later, within each step."""
    seconds = late(record)
    signals = {name: values.copy() for name, values in record.signals.items()}
    for step in record.steps:
        here = slice(step.start, step.stop)
        time = record.time[here]
        for name, values in signals.items():
            if name != CURRENT.name:
                values[here] = np.interp(time - seconds[here], time, record.signals[name][here])
    return record.changed(**signals)
