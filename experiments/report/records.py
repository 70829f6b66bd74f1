"""Errors of records, fitted and not fitted, as the rows that the command line, the report and notebooks print."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from ...core.ageing.fade_band import CAPACITY
from ...core.cell import SPECTRUM, TEMPERATURE
from ...core.comparison.record_errors import RecordErrors, SignalError
from ...core.inference.prediction import Band, Prediction
from ...core.signals import Signal
from ...core.task import Task
from .wording import duration, number, unit

_DIGITS = 3

_NAMED = 10
"""Cycles that are named one by one; of more the number is."""


UNDETERMINED = "not determined"
"""What is told of a 95 % band that is wider than the range of the records, in place of its width."""


@dataclass(frozen=True)
class ErrorRow:
    """One signal of one record, or of one of its steps, printed."""

    # record, part, use: The record (untrusted), its step (empty for all of it), and whether it was fitted.
    record: str
    part: str
    use: str
    # signal, unit, rms, most, largest: The error: root mean square, the same over 99 % of the time, and the largest.
    signal: str
    unit: str
    rms: str
    most: str
    largest: str
    # band, inside: Half the width of the 95 % band, median over the time, and the share of time within it. misfit: What
    # the misfit of the fitted records alone would make of that half width.
    band: str = ""
    inside: str = ""
    misfit: str = ""
    # That the simulation stopped early, or that the simulated cell ran into a limit; for a record that was not
    # simulated, why.
    remark: str = ""
    note: str = ""  # What else a reader wants to know of it.
    over: str = "time"  # What errors are averaged over.
    steps: tuple[ErrorRow, ...] = ()  # The same, step by step.
    followed: bool = True  # Whether the simulated cell was at no limit all the time; else the band is that of the rest.

    @property
    def line(self) -> str:
        """The row in words.

        ``"C20.csv, held out: voltage 12.1 mV rms (6.4 over 99 % of the time), largest error 55 mV"``.
        """
        who = f"{self.record}, {self.use}"
        remark = f"; {self.remark}" if self.remark else ""
        if not self.rms:
            return f"{who}: not simulated: {self.remark}"
        part = f"; ± {self.misfit} from the misfit of the fitted records" if self.misfit else ""
        half = f"{self.band} {self.unit} (median{part})"
        where = "" if self.followed else " in which the simulated cell was neither empty nor full"
        band = f"; 95 % band ± {half} holds {self.inside} of the {self.over}{where}" if self.band else ""
        band = f"; 95 % band {self.band}" if self.band == UNDETERMINED else band
        note = f"; {self.note}" if self.note else ""
        return (
            f"{who}: {self.signal} {self.rms} {self.unit} rms ({self.most} over 99 % of the {self.over}), "
            f"largest error {self.largest} {self.unit}{band}{note}{remark}"
        )


def error_rows(task: Task, records: Sequence[RecordErrors], held_out: Sequence[Prediction] = ()) -> list[ErrorRow]:
    """A row for each compared signal of each record, those that were fitted first."""
    rows = [row for errors in records for row in _rows(task, errors, "fitted", {})]
    return rows + [
        replace(row, followed=not found.at_limit)
        for found in held_out
        for row in _rows(task, found.errors, "held out", dict(found.bands))
    ]


def errors_words(
    signals: Iterable[Signal], errors: RecordErrors, before: RecordErrors | None = None, where: str = ""
) -> str:
    """``"Voltage RMSE of this record: 12 mV before, 0.4 mV after."``, for each of the signals that was compared."""
    sentences = []
    for signal in signals:
        if signal.name not in errors.signals:
            continue
        sizes = [_size(errors.signals[signal.name])]
        if before is not None and signal.name in before.signals:
            sizes = [f"{_size(before.signals[signal.name])} before", f"{sizes[0]} after"]
        sentences.append(f"{signal.title} RMSE{where}: {', '.join(sizes)}.")
    return " ".join(sentences)


def _size(error: SignalError) -> str:
    return f"{number(error.rms, _DIGITS)} {unit(error.unit)}"


def _rows(task: Task, errors: RecordErrors, use: str, bands: dict[str, Band]) -> list[ErrorRow]:
    if not errors.signals:
        return [ErrorRow(errors.record, "", use, "", "", "", "", "", remark=errors.failure)]
    words = {CAPACITY: CAPACITY} | {signal.name: signal.words for signal in (*task.observed, TEMPERATURE, *SPECTRUM)}
    experiment = next((e for e in (*task.experiments, *task.held_out) if e.name == errors.record), None)
    stopped = f"the simulation stopped early: {errors.failure}" if errors.failure else ""
    rows: list[ErrorRow] = []
    for name, error in errors.signals.items():
        steps = tuple(
            ErrorRow(errors.record, f"{step.name} ({duration(step.duration_s)})", use, *_printed(words[name], error))
            for step in errors.steps
            for error in [step.signals.get(name)]
            if error is not None
        )
        band = bands.get(name)
        told = ("", "", "") if band is None else _band(band)
        wide = _left_open(band, error.unit) if band is not None else ""
        remark = "; ".join(part for part in (stopped, *errors.limits, wide) if part)
        over = "cycles" if name == CAPACITY else "time" if errors.impedance is None else "decades"
        note = "" if errors.impedance is None or rows else errors.impedance.words
        if experiment is not None and experiment.long:
            note = "in percent of the first one" if name == CAPACITY else _step_by_step(experiment.detailed_cycles)
        row = ErrorRow(errors.record, "", use, *_printed(words[name], error), *told, remark, note, over, steps)
        rows.append(row)
    return rows


def _step_by_step(cycles: tuple[int, ...]) -> str:
    """What errors of the curves of a life are over."""
    named = f"cycles {', '.join(map(str, cycles))}" if len(cycles) <= _NAMED else f"{len(cycles)} cycles"
    return f"over the steps of {named}, each stretched to its measured duration"


def _left_open(band: Band, in_unit: str) -> str:
    """How much of a wide band is the parameters': the squares of what they and the misfit add to its half add up.

    Empty where the band is not wide.
    """
    if band.undetermined:
        return (
            "the 95 % band of the parameters that the fitted records leave open is wider than the range of these "
            "records and of this one"
        )
    if not band.wide:
        return ""
    own = math.sqrt(max(_half(band) ** 2 - band.misfit**2, 0.0))
    size = f"± {number(own, _DIGITS)} {unit(in_unit)}"
    return f"{size} of this band come from parameters that the fitted records leave open"


def _half(band: Band) -> float:
    return band.rms if math.isnan(band.median) else band.median


def _band(band: Band) -> tuple[str, str, str]:
    if band.undetermined:
        return UNDETERMINED, "", ""
    half = _half(band)
    misfit = number(band.misfit, _DIGITS) if band.misfit else ""
    return number(half, _DIGITS), f"{number(100 * band.inside, 2)} %", misfit


def _printed(signal: str, error: SignalError) -> tuple[str, str, str, str, str]:
    rms, most, largest = (number(value, _DIGITS) for value in (error.rms, error.rms_99, error.max))
    return signal, error.unit, rms, most, largest
