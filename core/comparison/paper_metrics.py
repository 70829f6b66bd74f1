"""How well a cell's simulation matches a record: the paper's metric, and the honest ones beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ..ageing.summary import discharged_ah
from ..errors import BsaError
from ..rms import rms
from ..simulation import Outcome
from ..task import Experiment, Task
from ..trajectory import FloatArray, Trajectory
from .alignment import pair_steps
from .overlap import JUMP_S, overlap_rms, scored_part
from .signal_metrics import Metrics, Quantity

_ZERO, _ZERO_SHARE = 1e-8, 5e-3
"""Reference samples smaller than this, or than this share of the largest, count as zero, since a relative error would
mean nothing: cyclers write up to three thousandths of their current while a cell rests."""

_DURATION_FLOOR_S = 1.0

_CLOSED = 0.1
"""Share of the discharged charge below which the net charge is next to nothing: the cycle ends where it began, and a
relative error of what is left would mean nothing. Its charge is then that of its discharge."""


@dataclass(frozen=True)
class PaperMetrics(Metrics):
    """Errors of one trial, averaged over the experiments of its task.

    The objective is ``mape`` where a protocol was simulated, ``v_rmse_mv`` where the measured current drove the cell
    (current and charge then match by construction); where weights are robust, the same over 99 % of the time.
    """

    mape: float  # The paper's total, ``q_mape + i_mape + v_mape``, in percent.
    # Percentage error of the charge drawn from the start of the record to the end of the scored part, one number (the
    # reading that reproduces the paper's "Default" rows; as a curve it does not). Of a record that ends where it began,
    # the discharged charge.
    q_mape: float
    # i_mape, v_mape: Mean absolute percentage error of current and voltage.
    i_mape: float
    v_mape: float
    rmse: float  # Sum of the three root-mean-square errors (A.h, A, V), as in the paper.
    v_rmse_mv: float  # Root-mean-square voltage error over the time both records cover, mV.
    step_duration_error: float  # Mean over the steps of ``|ln(simulated duration / measured duration)|``.
    # Relative error of the discharged capacity of the scored part; None where no record discharges.
    capacity_error: float | None


_VOLTAGE_RMSE = Quantity("v_rmse_mv", "Voltage RMSE", "mV", told="voltage_rmse_mv")
_ROBUST = Quantity("objective", "Voltage RMSE over 99 % of the time", "mV", told="voltage_rmse_99_pct_of_time_mv")
_TOTAL = Quantity("mape", "Total MAPE", "%", told="total_mape_pct")
_CHARGE = Quantity("q_mape", "Charge MAPE", "%", told="capacity_mape_pct")
_CURRENT = Quantity("i_mape", "Current MAPE", "%", told="current_mape_pct")
_VOLTAGE = Quantity("v_mape", "Voltage MAPE", "%", told="voltage_mape_pct")
_CAPACITY = Quantity("capacity_error", "Capacity error", "%", 100.0, told="discharged_capacity_error_pct")

ERRORS = (
    replace(_TOTAL, label="Total MAPE (charge + current + voltage)"),
    _CHARGE,
    _CURRENT,
    _VOLTAGE,
    Quantity("rmse", "Sum of RMSE (A h, A, V)", ""),
    replace(_VOLTAGE_RMSE, label="Voltage RMSE where both records exist"),
    Quantity("step_duration_error", "Step durations, mean |ln ratio|", ""),
    replace(_CAPACITY, label="Discharge capacity error"),
)
"""All errors, for a table."""


def objective_of(task: Task) -> Quantity:
    """The error that "best" means."""
    if not task.given_drive:
        return _TOTAL
    return _ROBUST if task.weight == "robust" else _VOLTAGE_RMSE


def headline_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that are shown first."""
    # A measured current gives charge and current away; what is left to judge is the voltage.
    if not task.given_drive:
        return _had((_TOTAL, _VOLTAGE_RMSE, _CAPACITY), task)
    return (_ROBUST, _VOLTAGE_RMSE) if task.weight == "robust" else (_VOLTAGE_RMSE,)


def errors_of(task: Task) -> tuple[Quantity, ...]:
    """All errors that judge a fit, for a table."""
    return (*headline_of(task), _VOLTAGE) if task.given_drive else _had(ERRORS, task)


def told_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that a proposer is told."""
    if task.given_drive:
        return errors_of(task)
    return _had((_TOTAL, _CHARGE, _CURRENT, _VOLTAGE, _VOLTAGE_RMSE, _CAPACITY), task)


def _had(quantities: tuple[Quantity, ...], task: Task) -> tuple[Quantity, ...]:
    """The errors without that of the capacity where no record of a task discharges."""
    if any(discharged_ah(experiment.scored_target) > 0 for experiment in task.experiments):
        return quantities
    return tuple(quantity for quantity in quantities if quantity.key != _CAPACITY.key)


def require_paper(task: Task, who: str) -> None:
    """Refuse a task that has no errors of charge, current and voltage apart.

    Raises `BsaError` naming who needs them.
    """
    if task.domain.metric != "paper":
        raise BsaError(
            f'{who} needs the errors of charge, current and voltage, which task "{task.name}" does not have.',
            "choose another scaffold: full, hybrid and least-squares know any signals.",
        )


def evaluate(task: Task, outcome: Outcome) -> PaperMetrics | None:
    """Compare an outcome with the task's targets. None if an experiment failed before the part that is scored."""
    rows: list[PaperMetrics] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        simulated = scored_part(run.trajectory, experiment)
        if simulated is None:
            return None
        assert run.trajectory is not None
        rows.append(_compare(task, simulated, run.trajectory, experiment))
    means: dict[str, Any] = {
        name: _mean([getattr(row, name) for row in rows]) for name in PaperMetrics.__dataclass_fields__
    }
    # A root mean square over several records is the root of the mean square.
    for name in ["v_rmse_mv", *(["objective"] if task.given_drive else [])]:
        means[name] = float(np.sqrt(np.mean([getattr(row, name) ** 2 for row in rows])))
    return PaperMetrics(**means)


def _mean(errors: Sequence[float | None]) -> float | None:
    """The mean over the records that have an error; None for none."""
    known = [error for error in errors if error is not None]
    return float(np.mean(known)) if known else None


def _compare(task: Task, simulated: Trajectory, whole: Trajectory, experiment: Experiment) -> PaperMetrics:
    target = experiment.scored_target
    q_ours, q_theirs = _final_charge(whole, experiment), _final_charge(experiment.target, experiment)
    if abs(q_theirs) < _CLOSED * discharged_ah(target):
        q_ours, q_theirs = discharged_ah(simulated), discharged_ah(target)
    q_mape = _mape(np.array([q_ours]), np.array([q_theirs]))
    i_mape, i_rmse = curve_errors(simulated, target, "current")
    v_mape, v_rmse = curve_errors(simulated, target, "voltage")
    mape = q_mape + i_mape + v_mape
    driven = experiment.protocol is None
    v_rmse_mv = 1e3 * overlap_rms(simulated, target, "voltage", driven)
    judged_mv = 1e3 * overlap_rms(simulated, target, "voltage", driven, True) if task.weight == "robust" else v_rmse_mv
    return PaperMetrics(
        objective=judged_mv if driven else mape,
        mape=mape,
        q_mape=q_mape,
        i_mape=i_mape,
        v_mape=v_mape,
        rmse=abs(q_ours - q_theirs) + i_rmse + v_rmse,
        v_rmse_mv=v_rmse_mv,
        step_duration_error=step_duration_error(whole, experiment),
        capacity_error=_capacity_error(simulated, target),
    )


def _final_charge(record: Trajectory, experiment: Experiment) -> float:
    """Net charge drawn from the start of the record to the end of its scored part, A.h."""
    stops = [step.stop for step in record.steps if step.cycle == experiment.scored_cycle]
    return float(record.discharge_capacity[(stops[-1] if stops else len(record)) - 1])


def curve_errors(simulated: Trajectory, target: Trajectory, signal: str) -> tuple[float, float]:
    """MAPE in percent and RMSE of a signal on the common grid, the shorter padded with zeros at its end."""
    ours, theirs = _resampled(simulated, signal), _resampled(target, signal)
    length = max(len(ours), len(theirs))
    ours, theirs = np.pad(ours, (0, length - len(ours))), np.pad(theirs, (0, length - len(theirs)))
    return _mape(ours, theirs), rms(ours - theirs)


def _resampled(record: Trajectory, signal: str) -> FloatArray:
    """A signal on a grid of 1 s from its own start, by PCHIP (paper, Sec. 4.1)."""
    values = record.values(signal)
    # The two sides of a jump share a stamp, or not, by rounding. Dropping one side would turn the jump into a
    # ramp to the next sample, half a minute on; so the stamps are rounded and then kept a microsecond apart.
    gaps = JUMP_S * np.arange(len(record))
    time = np.maximum.accumulate(np.round(record.time - record.time[0], 6) - gaps) + gaps
    if len(time) < 2:
        return np.asarray(values[-1:])
    return np.asarray(PchipInterpolator(time, values)(np.arange(0.0, time[-1], 1.0)), dtype=np.float64)


def is_counted(reference: FloatArray, largest: float) -> NDArray[np.bool_]:
    """Which samples of a reference, whose largest is given, the percentage errors count: those that are not zero."""
    return np.asarray(np.abs(reference) > max(_ZERO, _ZERO_SHARE * largest))


def _mape(simulated: FloatArray, reference: FloatArray) -> float:
    counted = is_counted(reference, float(np.max(np.abs(reference), initial=0.0)))
    if not np.any(counted):
        return 0.0
    return float(100.0 * np.mean(np.abs((simulated[counted] - reference[counted]) / reference[counted])))


def step_duration_error(simulated: Trajectory | None, experiment: Experiment) -> float:
    """Mean over the scored steps of the absolute logarithm of simulated over measured duration."""
    errors = [
        abs(np.log((pair.duration_s[1] + _DURATION_FLOOR_S) / (pair.duration_s[0] + _DURATION_FLOOR_S)))
        for pair in pair_steps(simulated, experiment)
    ]
    return float(np.mean(errors)) if errors else 0.0


def _capacity_error(simulated: Trajectory, target: Trajectory) -> float | None:
    ours, theirs = discharged_ah(simulated), discharged_ah(target)
    return abs(ours - theirs) / theirs if theirs > 0 else None
