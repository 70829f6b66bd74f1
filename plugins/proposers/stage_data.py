"""The part of the records that informs a stage of a calibration, as a view on the residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...core.residuals import ResidualRows, rows_of
from ...core.task import Task
from ...core.trajectory import FloatArray, Trajectory

Data = Literal["open-circuit", "current-steps", "rates", "temperature", "first-cycle", "life", "everything"]

_SLOW_PER_H = 0.12
"""Currents up to C/10 show nearly the open-circuit curve: some 10 mV of polarisation, with the sign of the current. The
tenth is of the nominal capacity, of which a measured cell gives down to five sixths."""

_RELAXED_S = 600.0
"""What a rest shows after ten minutes is the open-circuit voltage to a few mV, except at the ends of the curve."""

_COVERED = 0.5
"""Share of the cell's charge that open-circuit data must cover to say how the electrodes are balanced."""

_INSTANT_S = 60.0
"""What the voltage does within a minute of a current step is ohmic and kinetic; later diffusion shows."""

_VOLTAGE, _TEMPERATURE = "voltage", "temperature"


@dataclass(frozen=True, eq=False)
class View:
    """Some of the residuals, or differences between them.

    Attributes
    ----------
    rows, less : ndarray of int, shape (k,)
        Places of the residuals, and of those that are taken off them; -1 for none.
    weights, less_weights : ndarray of shape (k,)
        What both are multiplied by.
    lacking : str
        Why there are none; empty where there are.
    """

    rows: NDArray[np.intp]
    weights: FloatArray
    less: NDArray[np.intp] | None = None
    less_weights: FloatArray | None = None
    lacking: str = ""

    def __call__(self, residual: FloatArray) -> FloatArray:
        """The residuals of the view, from those of the task."""
        seen = self.weights * residual[self.rows]
        if self.less is None or self.less_weights is None:
            return np.asarray(seen)
        return np.asarray(seen - self.less_weights * residual[self.less])


def view_of(task: Task, data: Data) -> View:
    """What a stage looks at.

    Parameters
    ----------
    task : Task
        The records.
    data : str
        ``"open-circuit"`` for rests after ten minutes and currents up to C/10; ``"current-steps"`` for the first
        minute after each step of the current, against the voltage before it; ``"rates"`` for higher currents;
        ``"temperature"`` for the measured temperature; ``"first-cycle"`` for a record's first cycle, in which a cell
        has not aged; ``"life"`` for the cycles after it, those of a table of cycles among them; ``"everything"``.
    """
    rows = rows_of(task)
    if data == "everything":
        return View(np.arange(len(rows.record)), np.ones(len(rows.record)))
    if data in ("first-cycle", "life"):
        first = _in_first_cycle(task, rows)
        lacking = "the records have one cycle each" if data == "life" else "the records have no cycles"
        return _plain(rows, first if data == "first-cycle" else ~first, lacking)
    if data == _TEMPERATURE:
        return _plain(rows, rows.signal == _TEMPERATURE, "no temperature is compared")
    capacity_ah = max(float(np.ptp(experiment.target.discharge_capacity)) for experiment in task.experiments)
    if capacity_ah <= 0:
        return _none("no charge flows in the records")
    if data == "current-steps":
        return _current_steps(task, rows, capacity_ah)
    rates = _rates(task, rows) / capacity_ah
    if data == "rates":
        return _plain(rows, (rows.signal != _TEMPERATURE) & (rates > _SLOW_PER_H), "no current exceeds C/10")
    return _open_circuit(task, rows, rates, capacity_ah)


def _none(lacking: str) -> View:
    return View(np.zeros(0, dtype=np.intp), np.zeros(0), lacking=lacking)


def _plain(rows: ResidualRows, chosen: NDArray[np.bool_], lacking: str) -> View:
    places = np.flatnonzero(chosen)
    return View(places, np.ones(len(places))) if len(places) else _none(lacking)


def _in_first_cycle(task: Task, rows: ResidualRows) -> NDArray[np.bool_]:
    cycles = [[step.cycle for step in experiment.target.steps] for experiment in task.experiments]
    return np.array([cycles[n][step] == cycles[n][0] for n, step in zip(rows.record, rows.step, strict=True)])


def _rates(task: Task, rows: ResidualRows) -> FloatArray:
    """Mean current of each residual's step, without sign, A."""
    means = [
        [float(np.mean(np.abs(record.current[step.start : step.stop]))) for step in record.steps]
        for record in (experiment.target for experiment in task.experiments)
    ]
    return np.array([means[record][step] for record, step in zip(rows.record, rows.step, strict=True)])


def _open_circuit(task: Task, rows: ResidualRows, rates: FloatArray, capacity_ah: float) -> View:
    resting = rates < 0.01 * _SLOW_PER_H
    chosen = (rows.signal == _VOLTAGE) & (rates <= _SLOW_PER_H) & (~resting | (rows.since_s >= _RELAXED_S))
    charges = [
        float(np.ptp([_charge_at(task.experiments[record].target, rows, int(place)) for place in places]))
        for record in set(rows.record[chosen])
        for places in [np.flatnonzero(chosen & (rows.record == record))]
    ]
    if max(charges, default=0.0) < _COVERED * capacity_ah:
        return _none("rests of ten minutes and currents up to C/10 cover less than half of the charge")
    return _plain(rows, chosen, "")


def _charge_at(record: Trajectory, rows: ResidualRows, place: int) -> float:
    time = record.time[record.steps[rows.step[place]].start] + rows.since_s[place]
    return float(np.interp(time, record.time, record.discharge_capacity))


def _current_steps(task: Task, rows: ResidualRows, capacity_ah: float) -> View:
    """Voltage in the first minute less that before it; each current step counts the same."""
    found: list[tuple[NDArray[np.intp], int]] = []
    voltage = (rows.signal == _VOLTAGE) & (rows.scale > 0)
    for number, experiment in enumerate(task.experiments):
        record = experiment.target
        for place in range(1, len(record.steps)):
            step = record.steps[place]
            if abs(record.current[step.start] - record.current[step.start - 1]) < _SLOW_PER_H * capacity_ah:
                continue
            own = voltage & (rows.record == number)
            after = np.flatnonzero(own & (rows.step == place) & (rows.since_s <= _INSTANT_S))
            before = np.flatnonzero(own & (rows.step == place - 1))
            if len(after) and len(before):
                found.append((after, int(before[-1])))
    if not found:
        return _none("no step of the current is sampled within a minute")
    places = np.concatenate([after for after, _ in found])
    less = np.concatenate([np.full(len(after), before) for after, before in found])
    shares = np.concatenate([np.full(len(after), len(after) ** -0.5) for after, _ in found])
    return View(places, shares / rows.scale[places], less, shares / rows.scale[less])
