"""The figures of a report: the fit before and after, and how the error fell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import zero_Celsius
from scipy.interpolate import PchipInterpolator

from ...core.comparison.overlap import scored_part
from ...core.inference.prediction import Prediction, band_of, followed
from ...core.metrics import Quantity
from ...core.printable import counted
from ...core.signals import Signal
from ...core.task import Experiment, Task
from ...core.trajectory import FloatArray, StepKind, Trajectory
from ...core.trial import Trial
from ...plugins.feedback.ageing import told_cycles
from ..run_record import RunRecord
from .chart import Chart, Key, Marker, Panel, horizontal, limits_around, residual_limit
from .nyquist import nyquist
from .records import errors_words
from .wording import number, time_unit, unit

_DRIVEN_HEIGHT, _OBSERVED_HEIGHT, _RESIDUAL_HEIGHT, _CONVERGENCE_HEIGHT = 96.0, 210.0, 110.0, 250.0

_LONGEST = 1.5
"""Times a record's length up to which a simulation that ends later is drawn: a longer axis would squeeze the record."""

_ROOM_ABOVE = 2.2
"""Times the largest objective at which its axis ends."""

_LEAST_RESIDUAL = 0.5
"""Smallest end of a residual's axis, in tolerances: below it there is nothing to see but noise."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """One record with its simulations."""

    name: str  # The record's name. Untrusted.
    chart: Chart  # What was driven above what was observed, each above its residual.
    remarks: tuple[str, ...]  # What the reader must know to read it.
    # Its scored errors before and after, in a sentence for each observed signal; the drawn curves are thinned and tell
    # others. Empty where it was not scored.
    fit: str
    signed: bool = True  # Whether a signal is drawn whose sign has to be told.


@dataclass(frozen=True, eq=False)
class _Curve:
    """A scored curve on its own clock."""

    style: str
    record: Trajectory

    @property
    def time(self) -> FloatArray:
        return np.asarray(self.record.time - self.record.time[0])

    def values(self, signal: Signal) -> FloatArray:
        """A signal, in its unit."""
        return self.record.values(signal.name)

    def residual(self, measured: _Curve, signal: Signal) -> tuple[FloatArray, FloatArray]:
        """Simulated minus measured where both exist: times, and values in the signal's shown unit.

        Stored curves are thinned; inside a step they are smooth, and monotone cubics give the samples between.
        """
        times: list[FloatArray] = []
        values: list[FloatArray] = []
        begins: list[bool] = []
        taken = ~measured.record.inserted
        theirs = measured.time[taken]
        for step, piece in self.record.pieces():
            time, places = np.unique(piece.time - self.record.time[0], return_index=True)
            value = piece.values(signal.name)[places]
            if len(time) > 2 and step.kind is not StepKind.DRIVE:
                between = theirs[(theirs > time[0]) & (theirs < time[-1])]
                curve = PchipInterpolator(time, value)
                time = np.union1d(time, between)
                value = np.asarray(curve(time))
            times.append(time)
            values.append(value)
            begins += [True, *[False] * (len(time) - 1)]
        time = np.concatenate(times) if times else self.time
        value = np.concatenate(values) if times else self.values(signal)
        # Where a step begins at a switch that no sample shows, the sample before it is of another step.
        first = np.array(begins or np.zeros(len(time)), dtype=np.bool_) & np.isin(time, measured.time[~taken])
        known = (time <= theirs[-1] + 1e-9) & ~measured.unmeasured(time) & ~first
        measured_there = np.interp(time[known], theirs, measured.values(signal)[taken])
        return time[known], signal.shown_scale * (value[known] - measured_there)

    def unmeasured(self, time: FloatArray) -> NDArray[np.bool_]:
        """Whether the current was switched between the two samples that stand around a time: neither tells of it."""
        inserted = self.record.inserted
        taken = self.time[~inserted]
        switched = np.searchsorted(taken, self.time[inserted], side="right")
        place = np.searchsorted(taken, time, side="left")
        return np.isin(place, switched) & (time < taken[np.minimum(place, len(taken) - 1)])


def overlays(run: RunRecord) -> list[Overlay]:
    """One figure for each record of the task; of a long record, one for each of the cycles that bend its fade."""
    return [
        _overlay(run, place, shown)
        for place, experiment in enumerate(run.task.experiments)
        for shown in (_cycles(experiment) if experiment.long else [experiment])
    ]


def _cycles(experiment: Experiment) -> list[Experiment]:
    """Cycles of a long record, each as a record of its own."""
    return [
        replace(experiment, name=f"{experiment.name}, cycle {cycle}", scored_cycle=cycle, detailed_cycles=())
        for cycle in told_cycles(experiment)
    ]


def prediction_overlays(task: Task, predictions: Sequence[Prediction]) -> list[Overlay]:
    """One figure for each record that was not fitted: measured, predicted, and the band around the residual."""
    by_name = {experiment.name: experiment for experiment in task.held_out}
    found = []
    for place, prediction in enumerate(predictions):
        experiment = by_name.get(prediction.errors.record)
        if experiment is None or prediction.curve is None or not len(prediction.curve):
            continue
        for shown in _cycles(experiment) if experiment.long else [experiment]:
            curve = scored_part(prediction.curve, shown)
            if curve is not None:
                signals = task.observed_in(shown.scored_target)
                fit = errors_words(signals, prediction.errors) if shown is experiment else ""
                found.append(_predicted(task, place, shown, curve, prediction, fit))
    return found


def _predicted(
    task: Task, place: int, experiment: Experiment, curve: Trajectory, prediction: Prediction, fit: str
) -> Overlay:
    measured, predicted = _Curve("measured", experiment.scored_target), _Curve("best", curve)
    keys = [Key("measured", "measured"), Key("best", "predicted")]
    if experiment.is_spectrum:
        bands = ("The 95 % bands of the two parts stand in the table alone.",) * bool(prediction.bands)
        return _spectrum(experiment.name, f"held-out-{place}", fit, [measured, predicted], keys, bands)
    title = "Measured and predicted over time, with the residual"
    chart, scale = _over_time(f"held-out-{place}", experiment, title, float(measured.time[-1]))
    remarks = ["Residual: predicted minus measured."]
    for panel, signal in _draw(chart, task, measured, [predicted], predicted, scale):
        half = _half_width(curve, signal, prediction)
        if half is None:
            continue
        for start, stop in _stretches(followed(predicted.time, prediction.at_limit)):
            for side in (-1.0, 1.0):
                panel.draw(predicted.time[start:stop] / scale, side * half[start:stop], "limit")
        keys.append(Key("limit", "95 % band"))
        remarks += _beyond_panel(panel, signal, half[followed(predicted.time, prediction.at_limit)])
    if prediction.at_limit:
        remarks.append("There is no band where the simulated cell is empty or full.")
    chart.keys += dict.fromkeys(keys)
    chart.description = fit
    return Overlay(experiment.name, chart, tuple(remarks), fit)


def _half_width(curve: Trajectory, signal: Signal, prediction: Prediction) -> FloatArray | None:
    """Half the width of a signal's 95 % band along its curve, in the shown unit; None if it has none to draw."""
    band = prediction.bands.get(signal.name)
    if band_of(signal.name) not in curve.signals or band is None or band.undetermined:
        return None
    left_open = signal.shown_scale * curve.values(band_of(signal.name))
    return np.hypot(left_open, band.misfit)


def _beyond_panel(panel: Panel, signal: Signal, half: FloatArray) -> list[str]:
    """That a band cannot be seen in its panel, and where it lies."""
    beyond = half > panel.axis.high
    if not np.any(beyond):
        return []
    most = "" if np.all(beyond) else " in part"
    least, largest = (f"{number(float(value), 3)} {unit(signal.shown)}" for value in (half.min(), half.max()))
    return [f"The 95 % band of the {signal.words}, ± {least} to ± {largest}, lies{most} outside its panel."]


def _stretches(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First place of each run of true values, and one past its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _over_time(name: str, experiment: Experiment, title: str, longest_s: float) -> tuple[Chart, float]:
    """An empty chart for so long a time, and how many seconds the unit of its axis has."""
    scale, clock_unit = time_unit(longest_s)
    name += f"-{experiment.scored_cycle}" if experiment.scored_cycle else ""
    return Chart(name, title, horizontal(0.0, longest_s / scale), f"Time / {clock_unit}"), scale


def _overlay(run: RunRecord, place: int, experiment: Experiment) -> Overlay:
    measured = _Curve("measured", experiment.scored_target)
    initial = _simulated(run.initial, place, experiment, "initial")
    best = _simulated(run.best, place, experiment, "best") if run.best is not run.initial else None
    simulated = [curve for curve in (initial, best) if curve is not None]
    focus = best or initial
    keys = [Key("measured", "measured")]
    if initial is not None:
        keys.append(Key("initial", "initial" if best is not None or run.best is not run.initial else "initial = best"))
    if best is not None:
        keys.append(Key("best", f"best (simulation {run.best.index})"))
    fit = _scored(run, experiment)
    if experiment.is_spectrum:
        return _spectrum(experiment.name, f"overlay-{place}", fit, [measured, *simulated], keys)
    longest = max([measured.time[-1], *(min(curve.time[-1], _LONGEST * measured.time[-1]) for curve in simulated)])
    names = [signal.words for signal in _shown(run.task, measured)]
    title = f"{', '.join(names).capitalize()} and residuals over time"
    chart, scale = _over_time(f"overlay-{place}", experiment, title, float(longest))
    residuals = _draw(chart, run.task, measured, simulated, focus, scale)
    chart.keys += keys
    chart.description = f"Measured record against the initial and the best simulation. {fit}".strip()
    remarks = _remarks(run, place, experiment, residuals, initial, measured)
    return Overlay(experiment.name, chart, tuple(remarks), fit)


def _scored(run: RunRecord, experiment: Experiment) -> str:
    """The errors of the initial and the best simulation; empty of one cycle of a life, which is scored as a whole."""
    before, after = (
        next((errors for errors in scored if errors.record == experiment.name), None)
        for scored in (run.initial_records, run.records)
    )
    signals = run.task.observed_in(experiment.scored_target)
    return "" if after is None else errors_words(signals, after, before, " of this record")


def _spectrum(
    name: str,
    chart: str,
    fit: str,
    curves: Sequence[_Curve],
    keys: Sequence[Key],
    remarks: tuple[str, ...] = (),
) -> Overlay:
    drawn = {curve.style: curve.record for curve in curves}
    description = f"Measured and simulated impedance. {fit}".strip()
    return Overlay(name, nyquist(chart, description, drawn, keys), remarks, fit, signed=False)


def _simulated(trial: Trial, place: int, experiment: Experiment, style: str) -> _Curve | None:
    part = scored_part(trial.curves[place] if place < len(trial.curves) else None, experiment)
    return None if part is None or len(part) == 0 else _Curve(style, part)


def _shown(task: Task, measured: _Curve) -> list[Signal]:
    return [*_driven(task, measured), *task.observed_in(measured.record)]


def _driven(task: Task, measured: _Curve) -> list[Signal]:
    return [signal for signal in task.driven if signal.name in measured.record.signals]


def _draw(
    chart: Chart, task: Task, measured: _Curve, simulated: list[_Curve], focus: _Curve | None, scale: float
) -> list[tuple[Panel, Signal]]:
    """A panel for each signal, below that of each observed one the residuals, scaled for ``focus``; the latter."""
    residuals: list[tuple[Panel, Signal]] = []
    for signal in _shown(task, measured):
        driven = signal.role == "driven"
        # Temperatures are drawn in degC, as they are told everywhere; their residuals are differences, in K.
        zero, shown_unit = (zero_Celsius, "degC") if signal.unit == "K" else (0.0, unit(signal.unit))
        values = {curve: curve.values(signal) - zero for curve in (measured, *simulated)}
        label, limits = f"{signal.title} / {shown_unit}", limits_around(list(values.values()))
        panel = chart.panel(label, limits, *((_DRIVEN_HEIGHT, 3) if driven else (_OBSERVED_HEIGHT, 5)))
        panel.shows_zero = driven and panel.axis.low < 0 < panel.axis.high
        for curve, found in values.items():
            panel.draw(curve.time / scale, found, curve.style)
        if focus is not None and not driven:
            least = _LEAST_RESIDUAL * signal.tolerance * signal.shown_scale
            size = residual_limit([focus.residual(measured, signal)[1]], least)
            panel = chart.panel(f"Residual / {unit(signal.shown)}", (-size, size), _RESIDUAL_HEIGHT)
            panel.shows_zero = True
            for curve in simulated:
                time, residual = curve.residual(measured, signal)
                panel.draw(time / scale, residual, curve.style)
            residuals.append((panel, signal))
    return residuals


def _remarks(
    run: RunRecord,
    place: int,
    experiment: Experiment,
    residuals: list[tuple[Panel, Signal]],
    initial: _Curve | None,
    measured: _Curve,
) -> list[str]:
    remarks = []
    if experiment.scored_cycle is not None:
        remarks.append(f"Cycle {experiment.scored_cycle} is scored and shown, each curve from its own start.")
    if experiment.protocol is None:
        names = " and ".join(signal.words for signal in _driven(run.task, measured))
        if names:
            but = ", except where the simulated cell is empty or full" if run.initial.limits or run.best.limits else ""
            remarks.append(
                f"The measured {names} drives the simulation, so measured and simulated {names} coincide{but}."
            )
    if initial is None:
        remarks.append("The initial simulation did not reach the part that is shown.")
    elif run.initial.curves[place] is not None and run.initial.failure is not None:
        remarks.append("The initial simulation stopped early.")
    if residuals:
        beyond = initial is not None and any(
            np.any(np.abs(initial.residual(measured, signal)[1]) > panel.axis.high) for panel, signal in residuals
        )
        remarks.append(
            "Residual: simulated minus measured, scaled for the best fit"
            + ("; larger values run off the panel." if beyond else ".")
        )
    return remarks


def convergence(run: RunRecord, objective: Quantity) -> Chart | None:
    """The objective of every simulation, and the best so far; None if no simulation succeeded."""
    good = [trial for trial in run.trials if np.isfinite(_ROOM_ABOVE * trial.objective)]
    if not good:
        return None
    values = np.array([trial.objective for trial in good])
    positive = values[values > 0]
    low, high = (float(positive.min()), float(positive.max())) if len(positive) else (0.1, 1.0)
    across = horizontal(-0.6, max(run.trials[-1].index, 1) + 0.6)
    chart = Chart("convergence", "Objective by simulation", across, "Simulation")
    chart.x_ticks = [tick for tick in across.ticks(10) if tick.label.isdigit()]
    limits = (low / 1.6, _ROOM_ABOVE * high)
    panel = chart.panel(f"{objective.label} / {objective.unit}", limits, _CONVERGENCE_HEIGHT, log=True)
    indices = np.array([trial.index for trial in good], dtype=np.float64)
    steps_x = np.append(np.repeat(indices, 2)[1:], run.trials[-1].index)
    panel.draw(steps_x, np.repeat(np.minimum.accumulate(values), 2), "best")
    for trial in run.trials:
        _point(panel, trial, objective.unit, trial is run.best)
    chart.keys += [Key("best", "best so far"), Key("search", "search", "dot")]
    warm_up = [trial.index for trial in run.trials if trial.phase == "warm-up"]
    if warm_up:
        chart.keys.append(Key("warm-up", "warm-up", "dot"))
        chart.shade(min(warm_up) - 0.5, max(warm_up) + 0.5, "warm-up", least_width=60.0)
    if run.failed:
        chart.keys.append(Key("failed", f"failed ({run.failed})", "cross"))
    more = f"; {run.low_fidelity_simulations} by the low-fidelity model" * bool(run.low_fidelity_simulations)
    chart.description = (
        f"{objective.label} fell from {number(run.initial.objective)} to {number(run.best.objective)} "
        f"{objective.unit} in {counted(len(run.trials), 'simulation')}, {run.failed} of which failed{more}."
    )
    return chart


def _point(panel: Panel, trial: Trial, of_unit: str, is_best: bool) -> None:
    where = "initial" if trial.phase == "initial" else f"{trial.phase} round {trial.round}"
    if trial.ok:
        style = "reported" if is_best else trial.phase
        title = f"Simulation {trial.index} ({where}): {number(trial.objective)} {of_unit}"
        panel.point(trial.index, float(np.clip(trial.objective, panel.axis.low, panel.axis.high)), style, title)
        return
    x, y = float(panel.across.pixels(float(trial.index))), panel.top + 9.0
    if not trial.failed and trial.reduction is not None:
        words = f"Simulation {trial.index} ({where}) ran {trial.reduction.words}"
        panel.markers.append(Marker(x, y, trial.phase, words))
        return
    cause = trial.failure.cause if trial.failure else "nothing to compare"
    panel.markers.append(Marker(x, y, "failed", f"Simulation {trial.index} ({where}) failed: {cause[:200]}"))
