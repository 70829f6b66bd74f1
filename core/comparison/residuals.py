"""Residuals for numerical fitting: smooth in the parameters, each in units of its tolerance."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..ageing.residuals import compared_cycles, table_residuals
from ..cell import CURRENT
from ..signals import Signal
from ..simulation import ExperimentRun, Outcome
from ..task import Experiment, Task
from ..trajectory import FloatArray, Step, StepKind, Trajectory
from .alignment import StepPair, at_fractions, pair_steps
from .noise import noise_of
from .robust_loss import robust
from .step_parts import OSCILLATING, count_of_parts, step_parts

DURATION_TOLERANCE = 1e-3
"""Tolerance of a step's duration, as a share of it."""

DURATION = "duration"
"""What the misfit of durations is called beside those of signals."""

POINTS = 16
"""Points of a signal in a step under a protocol."""

_ZERO_SHARE = 0.1
"""Share of its peak by which a relative tolerance is wider, so that it is not zero where the signal is."""

_FAR = 10.0
"""Size of an error, in tolerances, from which robust weights reduce it: fits of physical models to measured cells leave
5 to 15 mV, and what is farther off is no part of that."""

_SHARE_OF_CHANGE = 0.02
"""Error of a model, as a share of what a pulse has changed the signal by, that counts as one tolerance. Models of cells
are off by some percent of a polarisation, however large that is: counted in mV, the largest pulses of a test from 0.5C
to 6C decide the resistance that all of them show, by which smaller currents are then predicted. One or two steps
of a fit of the Panasonic 18650PF from one point, with 0, 1, 2 and 5 %, predict the drive cycle US06 to 21.3, 17.9, 18.3
and 19.7 mV."""

_NEARLY_EMPTY = 0.15
"""Share of the charge of a pulse test at whose end the cell may be nearly empty: within seconds the particles' surfaces
run short of lithium, and a pulse shows two to ten times the resistance that it shows before."""

_SHORT_OF_LITHIUM = 1.5
"""Resistance of the pulses at the end of that share, in units of the usual one, from which they show a nearly empty
cell. It is 2.6 in the pulse test of the Panasonic 18650PF, which runs to 2.5 V, and 1.1 at most where that test is cut
off at up to four fifths of its charge."""

_PULSE_TEST = 10
"""Pulses before that share of the charge, from which on a record is a pulse test."""

_FLOORS_IN_BRIEF = 12.0
"""A brief step over this is added to both durations, so that a vanishing step has a finite logarithm and a 1 s rest
no weight (5 s for a cell)."""


@dataclass(frozen=True, eq=False)
class StepMisfit:
    """What one step adds to the sum of squared residuals."""

    experiment: Experiment  # The record.
    pair: StepPair  # The step, measured and simulated.
    squares: Mapping[str, float]  # Sum of squares by signal, and under ``"duration"`` that of the step's duration.


def misfits(task: Task, outcome: Outcome) -> list[StepMisfit]:
    """What each step that was reached adds to the sum of squared residuals, in order."""
    found: list[StepMisfit] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        pairs = [pair for pair in pair_steps(run.trajectory, experiment) if pair.reached]
        for pair, part in zip(pairs, _by_step(task, pairs, experiment), strict=True):
            signals = task.compared(pair.step.kind, experiment)
            names = [signal.name for signal in signals] + [DURATION] * (experiment.protocol is not None)
            split = np.split(part, np.cumsum([_count(pair.step.kind, signal, experiment) for signal in signals]))
            squares = {name: float(values @ values) for name, values in zip(names, split, strict=False)}
            found.append(StepMisfit(experiment, pair, squares))
    return found


def residuals(task: Task, outcome: Outcome) -> FloatArray | None:
    """Step-aligned residuals of all experiments, one after the other.

    Under a protocol each step of the scored cycle gives residuals of its compared signals (of a cell the
    voltage, during a voltage hold the current) at equal fractions of its own duration, and one residual for
    the logarithm of its duration. Under a measured drive the durations are given, and each step gives
    residuals of the observed signals, averages over parts of it (`step_parts`), weighted by their shares of time, so
    that the sum of squares is the number of residuals times the mean over the records of their mean squared errors.
    Where the task's weights are robust, mismatches of more than ten tolerances count by their order of magnitude
    (`robust`).

    Returns
    -------
    ndarray of shape (m,) or None
        The layout depends on the task alone; None if a simulation failed, or a cycle that is compared is not in its
        table of cycles: a life whose discharge ends before it begins goes on without it.
    """
    if not outcome.ok:
        return None
    parts: list[FloatArray] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        pairs = pair_steps(run.trajectory, experiment)
        if not all(pair.reached for pair in pairs):
            return None
        parts += _by_step(task, pairs, experiment)
        parts += _of_table(run.trajectory, experiment)
    joined = np.concatenate(parts)
    return joined if np.all(np.isfinite(joined)) else None


def partial_residuals(task: Task, outcome: Outcome) -> FloatArray | None:
    """Residuals of a simulation that failed, or was of the first cycles alone: those of the steps that it finished.

    Unlike `residuals` they do not stop at the scored cycle, which such a simulation may never reach.

    Returns
    -------
    ndarray of shape (k,) or None
        The layout depends on the task alone, and is that of `residuals` where every cycle is scored; NaN for steps not
        finished. None if no step was.
    """
    parts: list[FloatArray] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        whole = replace(experiment, scored_cycle=None)
        pairs = pair_steps(run.trajectory, whole)
        reached = _finished(pairs, run)
        for place, part in enumerate(_by_step(task, pairs, whole)):
            finished = place < reached and pairs[place].reached
            parts.append(part if finished else np.full_like(part, np.nan))
        parts += _of_table(run.trajectory, experiment)
    joined = np.concatenate(parts)
    return None if np.all(np.isnan(joined)) else joined


_NOISE_ORDER = 4
"""Order of the differences that tell the noise: a simulated record with a sample every half minute still has none."""


def noise_of_residuals(task: Task) -> FloatArray:
    """Standard deviations that the records' own noise gives the residuals, in tolerances, shape (m,); see `residuals`.

    A signal that is too short to tell its noise has none here, and so have durations: at the end of a step the
    voltage moves so fast that its noise hardly shifts it.
    """
    parts: list[FloatArray] = []
    for experiment in task.experiments:
        record = experiment.target
        known = {name: noise_of(record, values, _NOISE_ORDER) or 0.0 for name, values in record.signals.items()}
        noisy = replace(
            experiment, target=record.changed(**{name: values + known[name] for name, values in record.signals.items()})
        )
        # A simulation that equals the record but for an offset of one standard deviation: its residuals are the noise.
        pairs = pair_steps(record, noisy)
        curves = _by_step(task, pairs, experiment)
        if experiment.protocol is None:
            # Of the noise of many samples a mean keeps little.
            curves = [part * _kept_of_noise(task, pair, experiment) for part, pair in zip(curves, pairs, strict=True)]
        parts += curves + _of_table(record, experiment)
    return np.abs(np.concatenate(parts))


def _kept_of_noise(task: Task, pair: StepPair, experiment: Experiment) -> FloatArray:
    """Deviations of a driven step's residuals in units of those that a mismatch of the noise of one sample gives."""
    signals = task.compared(pair.step.kind, experiment)
    return np.concatenate([pair.kept_of_noise(step_parts(pair, signal).fractions) for signal in signals])


def _finished(pairs: list[StepPair], run: ExperimentRun) -> int:
    """How many of the record's steps a simulation has behind it: finished, or skipped before a finished one."""
    if run.failure is None:
        return len(pairs)
    behind = [place for place, pair in enumerate(pairs) if pair.simulated is not None]
    if behind and run.failure.unfinished and run.trajectory is not None:
        last = run.trajectory.steps[-1]
        cut = pairs[behind[-1]].simulated
        assert cut is not None
        # The step cut short counts only if the record has it: then it is the last of the pairs.
        if cut.time[-1] == run.trajectory.time[last.stop - 1]:
            behind.pop()
    return behind[-1] + 1 if behind else 0


def _of_table(simulated: Trajectory | None, experiment: Experiment) -> list[FloatArray]:
    """The residuals of a long record's cycle table; none of another record."""
    measured = experiment.target.cycle_table
    return [] if measured is None else [table_residuals(simulated, measured)]


def _by_step(task: Task, pairs: list[StepPair], experiment: Experiment) -> list[FloatArray]:
    return _driven(task, pairs, experiment) if experiment.protocol is None else _protocol(task, pairs, experiment)


def _protocol(task: Task, pairs: list[StepPair], experiment: Experiment) -> list[FloatArray]:
    brief_s = task.domain.brief_s
    floor_s = brief_s / _FLOORS_IN_BRIEF
    weight = _weight_of_curves(task, experiment)
    parts: list[FloatArray] = []
    for pair in pairs:
        curves = [
            _mismatch(task, pair, signal, experiment, np.linspace(0.0, 1.0, _points(signal)))
            # A rest of a second says what its neighbours say; let it not count 16 times.
            * (1.0 if signal.relative else min(1.0, pair.measured.duration / brief_s) ** 0.5)
            for signal in task.compared(pair.step.kind, experiment)
        ]
        measured_s, simulated_s = pair.duration_s
        ratio = np.log((simulated_s + floor_s) / (measured_s + floor_s))
        parts.append(weight * np.append(np.concatenate(curves), ratio / DURATION_TOLERANCE))
    return parts


def _weight_of_curves(task: Task, experiment: Experiment) -> float:
    """By what the residuals of curves are multiplied: of a life they count together as much as its cycle table.

    A curve has many more points than a table has lines, but where a model is not quite right neighbouring points err
    alike: counted one by one they would decide the fit, and the fade would follow wherever they lead.
    """
    table = experiment.target.cycle_table
    if table is None:
        return 1.0
    points = sum(
        1 + sum(_points(signal) for signal in task.compared(step.kind, experiment)) for step in experiment.target.steps
    )
    return min(1.0, float(np.sqrt(len(table_residuals(None, table)) / points)))


def _driven(task: Task, pairs: list[StepPair], experiment: Experiment) -> list[FloatArray]:
    durations = _durations_counted(pairs, experiment.target)
    total = sum(durations) or 1.0
    each = {signal.name: _parts_a_record(task, signal) for signal in task.signals_of(experiment)}
    parts: list[FloatArray] = []
    for pair, duration in zip(pairs, durations, strict=True):
        curves = []
        for signal in task.compared(pair.step.kind, experiment):
            part = step_parts(pair, signal)
            weights = np.sqrt(duration / total * each[signal.name] * part.weights)
            mismatch = _mismatch(task, pair, signal, experiment, part.fractions.ravel()).reshape(part.fractions.shape)
            if pair.step.kind is StepKind.PULSE:
                mismatch /= _wider(pair, signal, experiment, part.fractions)
            curves.append(weights * mismatch.mean(axis=1) * _tells_of_the_cell(signal, pair, part.ends))
        parts.append(np.concatenate(curves))
    return parts


def _wider(pair: StepPair, signal: Signal, experiment: Experiment, fractions: FloatArray) -> FloatArray:
    """By how much the tolerance of a signal is wider in a pulse, by what that has changed; shape of ``fractions``."""
    places = experiment.target.measured_across(pair.step)
    if places is None:
        return np.ones_like(fractions)
    before = experiment.target.values(signal.name)[places[0]]
    measured = at_fractions(pair.measured, pair.measured.values(signal.name), fractions)
    tolerance = tolerance_at(signal, np.abs(measured), experiment)
    return np.asarray(np.hypot(1.0, _SHARE_OF_CHANGE * (measured - before) / tolerance))


def _tells_of_the_cell(signal: Signal, pair: StepPair, ends: FloatArray) -> NDArray[np.bool_]:
    """Which of the parts of a step are fitted: in a long rest not those that show the surroundings alone.

    ``ends`` are the fractions of the step's duration at which the parts end, shape (n,).
    """
    if signal.settles_s is None or pair.step.kind is not StepKind.REST:
        return np.ones(len(ends), dtype=np.bool_)
    ends_s = pair.measured.duration * ends
    return np.asarray(ends_s <= max(signal.settles_s, ends_s[0]))


def _parts_a_record(task: Task, signal: Signal) -> float:
    """Mean number of parts of the driven records: what each of them weighs, however many it has itself.

    A pulse test has hundreds of steps and a discharge two. Misfits of a model that is not quite right repeat
    themselves from pulse to pulse, so that their number is no reason to count the discharge for nothing.
    """
    driven = [e.target.steps for e in task.experiments if e.protocol is None]
    return sum(count_of_parts(step.kind, signal) for steps in driven for step in steps) / len(driven)


def _durations_counted(pairs: list[StepPair], record: Trajectory) -> list[float]:
    """By how long each step of a driven record counts, s: its duration, and a pulse as long as the rest behind it.

    A pulse of ten seconds before a rest of twenty minutes is what the test was made for. The pulses of a nearly empty
    cell, and the rests behind them, do not count: no model comes near them, and they would decide the fit.
    """
    durations = [pair.measured.duration for pair in pairs]
    kinds = [pair.step.kind for pair in pairs]
    of_pulses = [kind is StepKind.PULSE for kind in kinds]
    if not any(of_pulses):
        return durations
    for place, (pulse, rest) in enumerate(pairwise(kinds)):
        if pulse is StepKind.PULSE and rest is StepKind.REST:
            durations[place] = max(durations[place : place + 2])
            of_pulses[place + 1] = True
    if CURRENT.name not in record.signals:
        return durations  # of what is no cell
    drawn = record.discharge_capacity
    empty_ah = drawn.max() - _NEARLY_EMPTY * np.ptp(drawn)
    empty = [bool(drawn[pair.step.start] > empty_ah) for pair in pairs]
    pulses = sum(kind is StepKind.PULSE and not late for kind, late in zip(kinds, empty, strict=True))
    if pulses < _PULSE_TEST or not _runs_short(pairs, record, empty):
        return durations
    dropped = [late and of_pulse for late, of_pulse in zip(empty, of_pulses, strict=True)]
    return [0.0 if out else duration for duration, out in zip(durations, dropped, strict=True)]


def _runs_short(pairs: list[StepPair], record: Trajectory, empty: list[bool]) -> bool:
    """Whether the pulses where the most charge was drawn show far more resistance than those of the cell before.

    The charge alone does not tell: a test may end at any state of charge. Pulses behind a rest are judged; ``empty``
    are the steps that may be of a nearly empty cell, of which the emptier half counts.
    """
    usual: list[float] = []
    late: list[tuple[float, float]] = []  # Charge drawn, and resistance.
    for (before, pair), may_be_empty in zip(pairwise(pairs), empty[1:], strict=True):
        if (before.step.kind, pair.step.kind) != (StepKind.REST, StepKind.PULSE):
            continue
        shown = _shown_resistance(record, pair.step)
        if shown is not None and may_be_empty:
            late.append((float(record.discharge_capacity[pair.step.start]), shown))
        elif shown is not None:
            usual.append(shown)
    if not usual or not late:
        return False
    emptiest = [shown for _, shown in sorted(late)[len(late) // 2 :]]
    return bool(np.median(emptiest) > _SHORT_OF_LITHIUM * np.median(usual))


def _shown_resistance(record: Trajectory, pulse: Step) -> float | None:
    """Voltage over current, both as they change from before a pulse to its end, ohm; None where that is not told."""
    places = record.measured_across(pulse)
    if places is None:
        return None
    ends = [places[0], pulse.stop - 1]
    (voltage,), (current,) = np.diff(record.voltage[ends]), np.diff(record.current[ends])
    return float(abs(voltage / current)) if current else None


def _mismatch(task: Task, pair: StepPair, signal: Signal, experiment: Experiment, fractions: FloatArray) -> FloatArray:
    """Simulated minus measured in tolerances, as the task weighs it."""
    measured, simulated = pair.curves(signal, fractions)
    size = measured
    if signal.share_of:
        size = at_fractions(pair.measured, pair.measured.values(signal.share_of), fractions)
    mismatch = np.asarray((simulated - measured) / tolerance_at(signal, np.abs(size), experiment))
    return robust(mismatch, _FAR) if task.weight == "robust" else mismatch


def tolerance_at(signal: Signal, size: Any, experiment: Experiment) -> Any:
    """What counts as a mismatch of a signal where it is so large, in the signal's unit; as many as there are sizes.

    The size is that of the signal itself, or of what its tolerance is a share of.
    """
    if not signal.relative:
        return signal.tolerance
    peak = float(np.max(np.abs(experiment.target.values(signal.share_of or signal.name)))) or 1.0
    return signal.tolerance * (size + _ZERO_SHARE * peak)


def _points(signal: Signal) -> int:
    """Points of a signal in a step under a protocol."""
    return max(POINTS, OSCILLATING) if signal.oscillates else POINTS


def _count(kind: str, signal: Signal, experiment: Experiment) -> int:
    """Residuals of a signal in a step."""
    return count_of_parts(kind, signal) if experiment.protocol is None else _points(signal)


def capacity_rows(task: Task) -> list[NDArray[np.intp]]:
    """Places of the residuals of capacity by cycle (`compared_cycles`), for each long record of a task."""
    found, about = [], rows_of(task).record
    for number, experiment in enumerate(task.experiments):
        table = experiment.target.cycle_table
        if table is not None:
            behind = int(np.flatnonzero(about == number)[-1]) + 1 - len(table_residuals(None, table))
            found.append(behind + np.arange(len(compared_cycles(table))))
    return found


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """What each residual of a task is about; arrays of shape (m,), see `residuals`."""

    # record, step: The experiment's place in the task and the step's place in its record.
    record: NDArray[np.intp]
    step: NDArray[np.intp]
    signal: NDArray[np.str_]  # Name of the signal; empty for the duration of a step and for a row of a table of cycles.
    since_s: FloatArray  # Time since the step began, s.
    scale: FloatArray  # The residual of a mismatch of one tolerance.


def rows_of(task: Task) -> ResidualRows:
    """What each residual of a task is about."""
    found: list[tuple[int, int, str, float]] = []
    scales: list[FloatArray] = []
    for number, experiment in enumerate(task.experiments):
        record = experiment.target
        off = {
            signal.name: values
            + tolerance_at(signal, np.abs(record.signals[signal.share_of or signal.name]), experiment)
            for signal in task.signals
            if (values := record.signals.get(signal.name)) is not None
        }
        # A simulation that equals the record but for one tolerance: its residuals are the scales.
        scales += _by_step(task, pair_steps(record.changed(**off), experiment), experiment)
        for pair in pair_steps(record, experiment):
            place = record.steps.index(pair.step)
            for signal in task.compared(pair.step.kind, experiment):
                if experiment.protocol is None:
                    fractions = step_parts(pair, signal).fractions.mean(axis=1)
                else:
                    fractions = (np.arange(_points(signal)) + 0.5) / _points(signal)
                times = pair.measured.duration * fractions
                found += [(number, place, signal.name, float(time)) for time in times]
            if experiment.protocol is not None:
                found.append((number, place, "", pair.measured.duration))
        if record.cycle_table is not None:
            scales.append(np.ones(len(table_residuals(record, record.cycle_table))))
            found += [(number, len(record.steps) - 1, "", 0.0)] * len(scales[-1])
    records, steps, names, seconds = (np.array(column) for column in zip(*found, strict=True))
    return ResidualRows(records, steps, names, seconds, np.abs(np.concatenate(scales)))
