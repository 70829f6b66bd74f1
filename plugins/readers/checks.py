"""What every reader does to its samples: checks, and the few repairs that are safe, each with a note."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...core.errors import BsaError
from ...core.record import ReadOptions, Record, Signal
from ...core.segmentation import segment
from ...core.trajectory import FloatArray, Trajectory

MIN_SAMPLES = 10
"""A record with fewer samples says nothing about a cell."""

MISSING_SHARE = 0.01
"""Rows without a value are left out up to this share of the record, or `MISSING_ROWS`; beyond, the file is refused."""

MISSING_ROWS = 3

BACKWARD_SHARE = 0.02
"""Rows whose clock runs back a little are left out up to this share of the record, or `BACKWARD_ROWS`."""

BACKWARD_ROWS = 5

RESTART_S = 60.0
"""A clock that runs back further than this (and ten usual intervals) has restarted, in s."""

GAP_S = 900.0
"""Silence longer than this (and twenty usual intervals) is noted as a gap, in s."""

VOLTAGE_RANGE_V = (0.0, 6.0)
"""What a single cell can show, in V."""

GLITCH_V = 0.4
"""A lone sample this far from both neighbours, which agree and carry the same current, is a glitch, in V."""

MAX_CURRENT_A = 2000.0

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Samples:
    """The signals of a file in SI units, in the sign convention of the file.

    Attributes
    ----------
    source : str
        Printable name of the file.
    rows : ndarray of shape (n,)
        Row of each sample in its file or sheet, from 1.
    time, voltage, current : ndarray of shape (n,)
        s, V and A; NaN where a cell is empty.
    temperature : ndarray of shape (n,) or None
        Kelvin, NaN where a cell is empty.
    names : mapping
        Columns as the file names them, for messages.
    notes : tuple of str
        What was done so far.
    ambient_k : float or None
        Ambient temperature, where the file has it.
    sheets : tuple of str
        Sheets (or workbooks and sheets) that the samples come from.
    sheet : ndarray of shape (n,)
        Sheet of each sample.
    """

    source: str
    rows: NDArray[np.int64]
    time: FloatArray
    voltage: FloatArray
    current: FloatArray
    temperature: FloatArray | None = None
    names: Mapping[Signal, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ambient_k: float | None = None
    sheets: tuple[str, ...] = ()
    sheet: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.time)

    def place(self, index: int) -> str:
        """Where a sample stands: ``row 12``, or ``row 12 of sheet Channel_1-008``."""
        row = f"row {self.rows[index]}"
        if self.sheet is None or not self.sheets:
            return row
        return f"{row} of sheet {self.sheets[int(self.sheet[index])]}"

    def places(self, indices: Sequence[int] | NDArray[np.intp]) -> str:
        """Where some samples stand, the first five of them."""
        named = [self.place(int(k)) for k in indices[:5]]
        if self.sheet is None and len(named) > 1:
            named = ["rows " + ", ".join(str(self.rows[int(k)]) for k in indices[:5])]
        return ", ".join(named) + (f" and {len(indices) - 5} more" if len(indices) > 5 else "")

    def column(self, signal: Signal) -> str:
        """The column's name in quotes."""
        return f'"{self.names.get(signal, signal)}"'

    def kept(self, keep: Mask, note: str = "") -> Samples:
        """The samples where ``keep`` is true, with one more note."""
        return replace(
            self,
            rows=self.rows[keep],
            time=self.time[keep],
            voltage=self.voltage[keep],
            current=self.current[keep],
            temperature=None if self.temperature is None else self.temperature[keep],
            sheet=None if self.sheet is None else self.sheet[keep],
            notes=(*self.notes, note) if note else self.notes,
        )

    def noted(self, note: str) -> Samples:
        """The same samples with one more note."""
        return replace(self, notes=(*self.notes, note))


def to_record(samples: Samples, options: ReadOptions) -> Record:
    """Check the samples, repair what is safe, turn the current and cut the record into steps.

    Parameters
    ----------
    samples : Samples
        As they stand in the file.
    options : ReadOptions
        Sign of the current, cycles to keep, ambient temperature.

    Returns
    -------
    Record

    Raises
    ------
    BsaError
        Naming the file, the row or column at fault and its value.
    """
    samples = without_missing(samples)
    _enough(samples)
    check_units(samples)
    samples = with_clock(samples)
    samples = without_glitches(samples)
    check_range(samples)
    samples = with_sign(samples, options)
    samples = with_gaps_noted(samples)
    _enough(samples)
    # `+ 0.0` turns the -0.0 of a rest into 0.0.
    trajectory = segment(Trajectory(samples.time, samples.current + 0.0, samples.voltage, samples.temperature))
    ambient = samples.ambient_k
    if options.ambient_c is not None:
        ambient = options.ambient_c + 273.15
    elif ambient is None and samples.temperature is not None:
        ambient = float(samples.temperature[0])
        samples = samples.noted(
            f"the ambient temperature is taken to be that of the first sample, {ambient - 273.15:.1f} degC."
        )
    trajectory = _selected(trajectory, options, samples.source)
    return Record(samples.source, trajectory, samples.notes, ambient)


def _enough(samples: Samples) -> None:
    if len(samples) < MIN_SAMPLES:
        raise BsaError(
            f"{samples.source} has only {len(samples)} samples; at least {MIN_SAMPLES} are needed.",
            "is it the stub of a test that was stopped? Give the whole record.",
        )


def without_missing(samples: Samples) -> Samples:
    """Leave out the few samples without a value; a temperature is interpolated or, if mostly missing, dropped."""
    if len(samples) == 0:
        return samples
    gone = np.zeros(len(samples), dtype=np.bool_)
    signals: dict[Signal, FloatArray] = {
        "time": samples.time,
        "voltage": samples.voltage,
        "current": samples.current,
    }
    for signal, values in signals.items():
        bad = ~np.isfinite(values)
        if np.count_nonzero(bad) > max(MISSING_ROWS, MISSING_SHARE * len(samples)):
            raise BsaError(
                f"{samples.source}: column {samples.column(signal)} has no number in {np.count_nonzero(bad)} of "
                f"{len(samples)} rows, first in {samples.place(int(np.flatnonzero(bad)[0]))}.",
                "fill or remove these rows (formulas in a workbook must be saved with their values).",
            )
        gone |= bad
    if gone.any():
        rows = np.flatnonzero(gone)
        samples = samples.kept(~gone, f"{len(rows)} samples without a value were left out ({samples.places(rows)}).")
    return _with_temperature(samples)


def _with_temperature(samples: Samples) -> Samples:
    temperature = samples.temperature
    if temperature is None or len(samples) == 0:
        return samples
    bad = ~np.isfinite(temperature)
    if not bad.any():
        return samples
    rows = np.flatnonzero(bad)
    if len(rows) > 0.1 * len(samples):
        samples = samples.noted(
            f"column {samples.column('temperature')} has no number in {len(rows)} of {len(samples)} rows; "
            "it is not used."
        )
        return replace(samples, temperature=None)
    filled = temperature.copy()
    filled[bad] = np.interp(rows, np.flatnonzero(~bad), filled[~bad])
    samples = samples.noted(f"{len(rows)} missing temperatures were interpolated ({samples.places(rows)}).")
    return replace(samples, temperature=filled)


def check_units(samples: Samples) -> None:
    """Refuse values that are off by the factor of a forgotten unit.

    Raises
    ------
    BsaError
        With the option that names the unit.
    """
    voltage = float(np.median(samples.voltage))
    if abs(voltage) > 100.0:
        _refuse_unit(samples, "voltage", f"{voltage:g} V", "mV")
    if voltage < 0.0:
        raise BsaError(
            f"{samples.source}: column {samples.column('voltage')} has a median of {voltage:g} V; "
            "a cell's voltage is positive.",
            "are two columns swapped? Say --column voltage=NAME and --column current=NAME.",
        )
    if voltage > VOLTAGE_RANGE_V[1]:
        raise BsaError(
            f"{samples.source}: column {samples.column('voltage')} has a median of {voltage:g} V, "
            f"more than a single cell can have.",
            "give the record of one cell, not of a pack (or divide by the cells in series).",
        )
    if 0.0 < float(np.max(samples.voltage)) < 0.05:
        _refuse_unit(samples, "voltage", f"at most {float(np.max(samples.voltage)):g} V", "V")
    current = float(np.quantile(np.abs(samples.current), 0.95))
    if current > MAX_CURRENT_A:
        _refuse_unit(samples, "current", f"{current:g} A", "mA")
    if samples.temperature is not None:
        kelvin = float(np.median(samples.temperature))
        if not 200.0 <= kelvin <= 400.0:
            other = "degC" if kelvin < 200.0 else "K"
            _refuse_unit(samples, "temperature", f"{kelvin - 273.15:.4g} degC ({kelvin:.4g} K)", other)
    duration = float(np.max(samples.time) - np.min(samples.time))
    swing = float(np.ptp(np.quantile(samples.voltage, [0.02, 0.98])))
    if len(samples) >= 50 and 0.0 < duration < 30.0 and swing > 0.5:
        _refuse_unit(samples, "time", f"{duration:g} s in all while the voltage moves by {swing:.2g} V", "h")


def _refuse_unit(samples: Samples, signal: Signal, value: str, unit: str) -> None:
    raise BsaError(
        f"{samples.source}: column {samples.column(signal)} shows {value}, which cannot be.",
        f"is it in {unit}? Then say --unit {signal}={unit}.",
    )


def with_clock(samples: Samples) -> Samples:
    """Make the time rise: lone spikes, repeated rows and small steps back are left out.

    Two samples may share a stamp where the current switches; both are kept.

    Raises
    ------
    BsaError
        If the clock restarts, or runs back too often.
    """
    spikes = np.zeros(len(samples), dtype=np.bool_)
    time = samples.time
    spikes[1:-1] = (time[1:-1] > time[2:]) & (time[2:] >= time[:-2])
    latest = np.maximum.accumulate(np.where(spikes, -np.inf, time))
    back = spikes | (time < latest)
    rising = np.diff(time[~back])
    usual = float(np.median(rising[rising > 0])) if np.any(rising > 0) else 0.0
    if usual == 0.0:
        raise BsaError(
            f"{samples.source}: column {samples.column('time')} never rises (it stays at {time[0]:g} s).",
            "say which column is the time with --column time=NAME.",
        )
    fallen = np.flatnonzero(~spikes & (latest - time > max(RESTART_S, 10.0 * usual)))
    if len(fallen):
        k = int(fallen[0])
        raise BsaError(
            f"{samples.source}: the clock restarts in {samples.place(k)} ({latest[k]:g} s, then {time[k]:g} s).",
            "the file holds several tests: choose one with --where COLUMN=VALUE, or cut the file at this row.",
        )
    if np.count_nonzero(back) > max(BACKWARD_ROWS, BACKWARD_SHARE * len(samples)):
        k = int(np.flatnonzero(back)[0])
        raise BsaError(
            f"{samples.source}: the time runs back in {np.count_nonzero(back)} of {len(samples)} rows, first around "
            f"{samples.place(k)} ({time[max(k - 1, 0)]:g} s, then {time[k]:g} s).",
            "sort the rows by time, or say which column is the time with --column time=NAME.",
        )
    if back.any():
        rows = np.flatnonzero(back)
        samples = samples.kept(~back, f"{len(rows)} samples out of time order were left out ({samples.places(rows)}).")
    return _without_repeats(samples)


def _without_repeats(samples: Samples) -> Samples:
    same = np.concatenate([[False], np.diff(samples.time) <= 0.0])
    if not same.any():
        return samples
    last_of_stamp = np.concatenate([~same[1:], [True]])
    scale = float(np.max(np.abs(samples.current)))
    first = np.maximum.accumulate(np.where(same, 0, np.arange(len(samples))))
    switches = np.abs(samples.current - samples.current[first]) > 0.02 * scale
    # Of the samples that share a stamp the first and, if the current has switched by then, the last are kept.
    keep = ~same | (last_of_stamp & switches)
    rows = np.flatnonzero(~keep)
    if len(rows) == 0:
        return samples
    if len(rows) > 0.5 * len(samples):
        raise BsaError(
            f"{samples.source}: {len(rows)} of {len(samples)} rows repeat the time of the row before, first "
            f"{samples.place(int(rows[0]))} ({samples.time[rows[0]]:g} s).",
            "export the time with more digits.",
        )
    return samples.kept(
        keep, f"{len(rows)} samples with the time of the one before were left out ({samples.places(rows)})."
    )


def without_glitches(samples: Samples) -> Samples:
    """Leave out lone voltage samples that no cell can produce.

    Raises
    ------
    BsaError
        If there are many.
    """
    v, i = samples.voltage, samples.current
    if len(samples) < 3:
        return samples
    scale = float(np.max(np.abs(i)))
    calm = (np.abs(i[1:-1] - i[:-2]) <= 0.05 * scale) & (np.abs(i[1:-1] - i[2:]) <= 0.05 * scale)
    before, after, across = v[1:-1] - v[:-2], v[1:-1] - v[2:], np.abs(v[2:] - v[:-2])
    lone = (np.minimum(np.abs(before), np.abs(after)) > GLITCH_V) & (before * after > 0)
    outside = (v[1:-1] < VOLTAGE_RANGE_V[0]) | (v[1:-1] > VOLTAGE_RANGE_V[1])
    bad = np.zeros(len(samples), dtype=np.bool_)
    bad[1:-1] = lone & (across < 0.25 * np.abs(before)) & (calm | outside)
    rows = np.flatnonzero(bad)
    if len(rows) == 0:
        return samples
    k = int(rows[0])
    if len(rows) > max(MISSING_ROWS, MISSING_SHARE * len(samples)):
        raise BsaError(
            f"{samples.source}: the voltage jumps for a single sample {len(rows)} times, first in {samples.place(k)} "
            f"({v[k - 1]:g} V, {v[k]:g} V, {v[k + 1]:g} V).",
            "the sense wire may be loose; repair the record first.",
        )
    values = ", ".join(f"{v[row]:g} V" for row in rows[:5])
    return samples.kept(~bad, f"{len(rows)} voltage glitches were left out ({values} in {samples.places(rows)}).")


def check_range(samples: Samples) -> None:
    """Refuse voltages outside `VOLTAGE_RANGE_V`.

    Raises
    ------
    BsaError
        Naming the first row and its value.
    """
    low, high = VOLTAGE_RANGE_V
    bad = np.flatnonzero((samples.voltage < low) | (samples.voltage > high))
    if len(bad):
        k = int(bad[0])
        raise BsaError(
            f"{samples.source}: {samples.place(k)}, column {samples.column('voltage')}: {samples.voltage[k]:g} V is no "
            f"voltage of a single cell ({low:g} to {high:g} V); {len(bad)} such rows.",
            "repair or remove these rows.",
        )


def with_sign(samples: Samples, options: ReadOptions) -> Samples:
    """Turn the current positive on discharge, after asking the voltage whether the stated sign can be true.

    Raises
    ------
    BsaError
        If the voltage contradicts the stated sign, or cannot tell where ``auto`` asks it.
    """
    _refuse_still_current(samples)
    evidence, start, stop = _discharge_positive(samples)
    stated = options.current_sign
    if stated == "auto":
        if abs(evidence) < 0.3:
            raise BsaError(
                f"{samples.source}: the voltage does not tell the sign of column {samples.column('current')}.",
                "say --current-sign charge-positive or --current-sign discharge-positive.",
            )
        stated = "discharge-positive" if evidence > 0 else "charge-positive"
        samples = samples.noted(f"the current was found to be {stated} in the file.")
    elif (evidence > 0.3 and stated == "charge-positive") or (evidence < -0.3 and stated == "discharge-positive"):
        other = "discharge-positive" if evidence > 0 else "charge-positive"
        way = "falls" if samples.voltage[stop] < samples.voltage[start] else "rises"
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} is {samples.current[(start + stop) // 2]:.4g} A "
            f"while the voltage {way} from {samples.voltage[start]:.4g} V ({samples.place(start)}) to "
            f"{samples.voltage[stop]:.4g} V ({samples.place(stop)}), so it is not {stated}.",
            f"say --current-sign {other}.",
        )
    return samples if stated == "discharge-positive" else replace(samples, current=-samples.current)


def _refuse_still_current(samples: Samples) -> None:
    swing = float(np.ptp(np.quantile(samples.voltage, [0.02, 0.98])))
    if not np.any(samples.current) and swing > 0.5:
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} is 0 A throughout while the voltage moves by "
            f"{swing:.2g} V.",
            "say which column is the current with --column current=NAME, or --constant-current.",
        )


def _discharge_positive(samples: Samples) -> tuple[float, int, int]:
    """Evidence from -1 (positive on charge) to 1 (positive on discharge), and the stretch that shows it best."""
    current, voltage = samples.current, samples.voltage
    scale = float(np.max(np.abs(current)))
    if scale == 0.0:
        return 0.0, 0, len(samples) - 1
    signs = np.where(np.abs(current) > 0.02 * scale, np.sign(current), 0.0)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(signs)) + 1, [len(signs)]])
    first, last = edges[:-1], edges[1:] - 1
    flowing = signs[first] != 0
    first, last = first[flowing], last[flowing]
    moves = voltage[last] - voltage[first]
    total = float(np.sum(np.abs(moves)))
    best = int(np.argmax(np.abs(moves)))
    trend = float(-np.sum(signs[first] * moves)) / total if total > 0.02 else 0.0
    if total > 0.5 and abs(trend) < 0.5 and (np.all(signs >= 0) or np.all(signs <= 0)):
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} never changes its sign, yet the voltage both rises "
            f"and falls under current (from {voltage[first[best]]:.4g} V in {samples.place(int(first[best]))} to "
            f"{voltage[last[best]]:.4g} V in {samples.place(int(last[best]))}).",
            "the file gives sizes only: export the current with its sign.",
        )
    steps, answers = np.diff(current), np.diff(voltage)
    size = float(np.sqrt(np.sum(steps**2) * np.sum(answers**2)))
    jump = -float(np.sum(steps * answers)) / size if size > 0 else 0.0
    # Trend and switches tell the same; where they contradict each other, neither counts.
    evidence = trend if abs(trend) >= 0.3 else jump
    if trend * jump < 0 and abs(jump) > 0.5:
        evidence = 0.0
    return evidence, int(first[best]), int(last[best])


def with_gaps_noted(samples: Samples) -> Samples:
    """Note long silences; nothing is filled in."""
    spacing = np.diff(samples.time)
    gaps = np.flatnonzero(spacing > max(GAP_S, 20.0 * float(np.median(spacing))))
    if len(gaps) == 0:
        return samples
    scale = float(np.max(np.abs(samples.current)))
    flowing = np.minimum(np.abs(samples.current[gaps]), np.abs(samples.current[gaps + 1])) > 0.02 * scale
    k = int(gaps[np.argmax(spacing[gaps])])
    note = f"{len(gaps)} gaps without samples, the longest of {spacing[k]:.4g} s after {samples.place(k)}"
    if flowing.any():
        note += f"; current flowed across {np.count_nonzero(flowing)} of them, so charge is uncertain there"
    return samples.noted(note + ".")


def _selected(trajectory: Trajectory, options: ReadOptions, source: str) -> Trajectory:
    if options.cycles is None:
        return trajectory
    first, last = options.cycles
    present = trajectory.cycles
    if first not in present or last not in present:
        raise BsaError(
            f"{source} has cycles {present[0]} to {present[-1]}, not {first} to {last}.",
            "choose among them with --cycles.",
        )
    steps = [step for step in trajectory.steps if first <= step.cycle <= last]
    return trajectory.slice(steps[0].start, steps[-1].stop)
