"""The part of the records that informs a stage of a calibration, as a view on the residuals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...core.cell import CURRENT, FREQUENCY, REACTANCE, RESISTANCE, TEMPERATURE, VOLTAGE
from ...core.comparison.paper_metrics import is_counted
from ...core.comparison.residuals import DURATION_TOLERANCE, ResidualRows, rows_of, tolerance_at
from ...core.reading.open_circuit import RELAXED_S
from ...core.task import Experiment, Task
from ...core.trajectory import FloatArray, Trajectory

Data = Literal["open-circuit", "current-steps", "rates", "temperature", "first-cycle", "life", "everything"]

_SLOW_PER_H = 0.12
"""Currents up to C/10 show nearly the open-circuit curve: some 10 mV of polarisation, with the sign of the current. The
tenth is of the nominal capacity, of which a measured cell gives down to five sixths."""

_COVERED = 0.5
"""Share of the cell's charge that open-circuit data must cover to say how the electrodes are balanced."""

_INSTANT_S = 60.0
"""What the voltage does within a minute of a current step is ohmic and kinetic; later diffusion shows."""

_KINETIC_HZ = 1.0
"""What impedance shows above this frequency is ohmic and kinetic; below, diffusion."""


@dataclass(frozen=True, eq=False)
class View:
    """Some of the residuals, or differences between them."""

    # rows, less: Places of the residuals, and of those that are taken off them, shape (k,).
    # weights, less_weights: What both are multiplied by.
    rows: NDArray[np.intp]
    weights: FloatArray
    less: NDArray[np.intp] | None = None
    less_weights: FloatArray | None = None
    lacking: str = ""  # Why there are none; empty where there are.

    def __call__(self, residual: FloatArray) -> FloatArray:
        """The residuals of the view, from those of the task."""
        seen = self.weights * residual[self.rows]
        if self.less is None or self.less_weights is None:
            return np.asarray(seen)
        return np.asarray(seen - self.less_weights * residual[self.less])


def view_of(task: Task, data: Data) -> View:
    """What a stage looks at.

    ``"open-circuit"`` stands for rests after ten minutes and currents up to C/10; ``"current-steps"`` for the first
    minute after each step of the current, against the voltage before it, and for spectra above 1 Hz; ``"rates"`` for
    higher currents; ``"temperature"`` for the measured temperature; ``"first-cycle"`` for a record's first cycle, in
    which a cell has not aged; ``"life"`` for the cycles after it, those of a table of cycles among them;
    ``"everything"``.
    """
    rows = rows_of(task)
    if data == "everything":
        return View(np.arange(len(rows.record)), _as_scored(task, rows))
    if data in ("first-cycle", "life"):
        first = _in_first_cycle(task, rows)
        lacking = "the records have one cycle each" if data == "life" else "the records have no cycles"
        return _plain(rows, first if data == "first-cycle" else ~first, lacking)
    if data == "temperature":
        return _plain(rows, rows.signal == TEMPERATURE.name, "no temperature is compared")
    over_time = [experiment.target for experiment in task.experiments if not experiment.is_spectrum]
    capacity_ah = max((float(np.ptp(record.discharge_capacity)) for record in over_time), default=0.0)
    if data == "current-steps":
        return _current_steps(task, rows, capacity_ah)
    if capacity_ah <= 0:
        return _none("no charge flows in the records")
    rates = _rates(task, rows) / capacity_ah
    if data == "rates":
        return _plain(rows, (rows.signal != TEMPERATURE.name) & (rates > _SLOW_PER_H), "no current exceeds C/10")
    return _open_circuit(task, rows, rates, capacity_ah)


def _as_scored(task: Task, rows: ResidualRows) -> FloatArray:
    """Weights of all residuals: under a protocol those by which each counts as it does in the score.

    The score adds percentages: of the charge, and of voltage and current as means over the time. A model that is not
    quite right cannot have all of them, and counted point by point the curves would decide: a discharge that ends two
    percent late then costs less than ten millivolts along its curve, and a percent of the current of a voltage hold no
    more than a millivolt.
    """
    weights = np.ones(len(rows.record))
    for number, experiment in enumerate(task.experiments):
        record = experiment.target
        if experiment.protocol is None or record.cycle_table is not None or task.domain.metric != "paper":
            continue
        own = rows.record == number
        durations = np.array([piece.duration for _, piece in record.pieces()])
        curves = own & (rows.signal != "")
        weights[curves] = np.sqrt(durations[rows.step[curves]] / np.mean(durations))
        # What a tolerance of the voltage is in percent, and what those of a duration and of the current are.
        share = VOLTAGE.tolerance / float(np.mean(np.abs(record.voltage)))
        weights[own & ~curves] = DURATION_TOLERANCE / share * np.sqrt(np.count_nonzero(curves))
        currents = own & (rows.signal == CURRENT.name)
        weights[currents] *= _relative_tolerance(experiment, rows.step[currents], rows.since_s[currents]) / share
    return weights


def _relative_tolerance(experiment: Experiment, steps: NDArray[np.intp], since_s: FloatArray) -> FloatArray:
    """A tolerance of the current as a share of the current, at times since such steps began.

    It is 0 where the score counts the current as zero.
    """
    record = experiment.target
    begins = np.array([record.time[step.start] for step in record.steps])
    amperes = np.abs(np.interp(begins[steps] + since_s, record.time, record.current))
    counted = is_counted(amperes, float(np.max(np.abs(record.current))))
    return np.where(counted, tolerance_at(CURRENT, amperes, experiment) / np.where(counted, amperes, 1.0), 0.0)


def _none(lacking: str) -> View:
    return View(np.zeros(0, dtype=np.intp), np.zeros(0), lacking=lacking)


def _plain(rows: ResidualRows, chosen: NDArray[np.bool_], lacking: str) -> View:
    places = np.flatnonzero(chosen)
    return View(places, np.ones(len(places))) if len(places) else _none(lacking)


def _in_first_cycle(task: Task, rows: ResidualRows) -> NDArray[np.bool_]:
    cycles = [[step.cycle for step in experiment.target.steps] for experiment in task.experiments]
    return np.array([cycles[n][step] == cycles[n][0] for n, step in zip(rows.record, rows.step, strict=True)])


def _rates(task: Task, rows: ResidualRows) -> FloatArray:
    """Mean current of each residual's step, without sign, A; none of a spectrum."""
    means = [
        [
            0.0 if experiment.is_spectrum else float(np.mean(np.abs(experiment.target.current[step.start : step.stop])))
            for step in experiment.target.steps
        ]
        for experiment in task.experiments
    ]
    return np.array([means[record][step] for record, step in zip(rows.record, rows.step, strict=True)])


def _open_circuit(task: Task, rows: ResidualRows, rates: FloatArray, capacity_ah: float) -> View:
    resting = rates < 0.01 * _SLOW_PER_H
    chosen = (rows.signal == VOLTAGE.name) & (rates <= _SLOW_PER_H) & (~resting | (rows.since_s >= RELAXED_S))
    charges = [
        _covered([_charge_at(task.experiments[record].target, rows, int(place)) for place in places])
        for record in set(rows.record[chosen])
        for places in [np.flatnonzero(chosen & (rows.record == record))]
    ]
    if max(charges, default=0.0) < _COVERED * capacity_ah:
        return _none("rests of ten minutes and currents up to C/10 cover less than half of the charge")
    return _plain(rows, chosen, "")


def _covered(charges: Sequence[float]) -> float:
    """The charge over which points are spread, without the widest gap: two rests say nothing of what is between."""
    return float(np.ptp(charges) - np.max(np.diff(np.sort(charges)), initial=0.0))


def _charge_at(record: Trajectory, rows: ResidualRows, place: int) -> float:
    time = record.time[record.steps[rows.step[place]].start] + rows.since_s[place]
    return float(np.interp(time, record.time, record.discharge_capacity))


def _current_steps(task: Task, rows: ResidualRows, capacity_ah: float) -> View:
    """Voltage in the first minute less that before it, and spectra above 1 Hz.

    Each current step counts the same, and so does each decade of a spectrum's parts.
    """
    found: list[tuple[NDArray[np.intp], int]] = []
    voltage = (rows.signal == VOLTAGE.name) & (rows.scale > 0)
    for number, experiment in enumerate(task.experiments):
        record = experiment.target
        if experiment.is_spectrum:
            continue
        for place in range(1, len(record.steps)):
            step = record.steps[place]
            if abs(record.current[step.start] - record.current[step.start - 1]) < _SLOW_PER_H * capacity_ah:
                continue
            measured = record.measured_across(step)
            if measured is None or record.time[measured[1]] - record.time[step.start - 1] > _INSTANT_S:
                continue
            own = voltage & (rows.record == number)
            after = np.flatnonzero(own & (rows.step == place) & (rows.since_s <= _INSTANT_S))
            before = np.flatnonzero(own & (rows.step == place - 1))
            if len(after) and len(before):
                found.append((after, int(before[-1])))
    spectra, weights = _kinetic_decades(task, rows)
    if not found and not len(spectra):
        return _none("no step of the current beyond C/10 is sampled within a minute")
    places = np.array([place for after, _ in found for place in after], dtype=np.intp)
    less = np.array([before for after, before in found for _ in after], dtype=np.intp)
    shares = np.array([len(after) ** -0.5 for after, _ in found for _ in after])
    return View(
        np.append(places, spectra),
        np.append(shares / rows.scale[places], weights),
        np.append(less, np.full(len(spectra), -1)),
        np.append(shares / rows.scale[less], np.zeros(len(spectra))),
    )


def _kinetic_decades(task: Task, rows: ResidualRows) -> tuple[NDArray[np.intp], FloatArray]:
    """Places of the residuals of spectra above 1 Hz, and the weights by which each decade of a part counts as one."""
    of_spectra = np.isin(rows.signal, (RESISTANCE.name, REACTANCE.name)) & (rows.scale > 0)
    places: list[NDArray[np.intp]] = [np.zeros(0, dtype=np.intp)]
    weights: list[FloatArray] = [np.zeros(0)]
    for number, experiment in enumerate(task.experiments):
        if not experiment.is_spectrum:
            continue
        own = np.flatnonzero(of_spectra & (rows.record == number))
        highest = float(experiment.target.values(FREQUENCY.name)[0])
        # The clock of a spectrum counts decades.
        kinetic = own[rows.since_s[own] <= np.log10(highest / _KINETIC_HZ)]
        a_decade = np.count_nonzero(rows.signal[own] == RESISTANCE.name) / experiment.target.duration
        places.append(kinetic)
        weights.append(a_decade**-0.5 / rows.scale[kinetic])
    return np.concatenate(places), np.concatenate(weights)
