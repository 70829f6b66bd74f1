"""What a number in a file may be: values that are missing, wild, or in another unit than the file says."""

import numpy as np

from ..errors import BsaError
from ..printable import counted, were
from ..record import Signal
from ..trajectory import LARGEST, FloatArray
from .samples import Mask, Samples

MISSING_SHARE = 0.01
"""Rows without a value are left out up to this share of the record, or `MISSING_ROWS`; beyond, the file is refused."""

MISSING_ROWS = 3
"""Rows that may be left out of a short record, of which `MISSING_SHARE` would be less."""

VOLTAGE_RANGE_V = (-0.01, 6.0)
"""What a single cell can show, in V. One that is drawn to 0 V shows a little less if its instrument is off."""

GLITCH_V = 0.4
"""A lone sample this far from both neighbours, which agree and carry the same current, is a glitch, in V."""

MAX_CURRENT_A = 2000.0
"""A record with one sample in twenty above this is taken for one in mA, in A."""


_EXCEL_DAYS = (32874.0, 73051.0)
"""The years 1990 to 2100 in days since 1899, as spreadsheets count dates."""


def without_missing(samples: Samples) -> Samples:
    """Leave out the few samples without a value. Raises `BsaError` if there are many."""
    gone = np.zeros(len(samples), dtype=np.bool_)
    signals: dict[Signal, FloatArray] = {"time": samples.time, "voltage": samples.voltage, "current": samples.current}
    for signal, values in signals.items():
        bad = ~np.isfinite(values)
        most = max(MISSING_ROWS, int(MISSING_SHARE * len(samples)))
        if np.count_nonzero(bad) > most:
            raise BsaError(
                f"{samples.source}: column {samples.column(signal)} has no number in {np.count_nonzero(bad)} of "
                f"{len(samples)} rows, first in {samples.place(int(np.flatnonzero(bad)[0]))}; up to {most} are "
                "left out.",
                "fill or remove these rows (formulas in a workbook must be saved with their values).",
            )
        gone |= bad
    return samples.without(gone, "without a value")


def check_size(samples: Samples) -> None:
    """Refuse numbers that no instrument writes, before anything is reckoned with them.

    Raises `BsaError` naming the row and its value.
    """
    signals: dict[Signal, FloatArray] = {"time": samples.time, "voltage": samples.voltage, "current": samples.current}
    for signal, values in signals.items():
        wild = np.flatnonzero(np.isfinite(values) & (np.abs(values) > LARGEST))
        if len(wild):
            k = int(wild[0])
            raise BsaError(
                f"{samples.source}: {samples.place(k)}, column {samples.column(signal)}: {values[k]:g} is no "
                f"measured number; {counted(len(wild), 'such row')}.",
                "repair or remove these rows.",
            )


def check_units(samples: Samples) -> None:
    """Refuse values that are off by the factor of a forgotten unit.

    Raises `BsaError` with the option that names the unit.
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
    duration = float(np.max(samples.time) - np.min(samples.time))
    swing = float(np.ptp(np.quantile(samples.voltage, [0.02, 0.98])))
    if len(samples) >= 50 and 0.0 < duration < 30.0 and swing > 0.5:
        unit = "d" if _EXCEL_DAYS[0] < float(np.min(samples.time)) < _EXCEL_DAYS[1] else "h"
        _refuse_unit(samples, "time", f"{duration:g} s in all while the voltage moves by {swing:.2g} V", unit)


def _refuse_unit(samples: Samples, signal: Signal, value: str, unit: str) -> None:
    raise BsaError(
        f"{samples.source}: column {samples.column(signal)} shows {value}, which cannot be.",
        f"is it in {unit}? Then say --unit {signal}={unit}.",
    )


def lone(values: FloatArray, limit: float) -> Mask:
    """Which values are further than a limit from both neighbours, on one side, while these agree; shape (n,)."""
    found = np.zeros(len(values), dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
        far = (np.minimum(np.abs(before), np.abs(after)) > limit) & (before * after > 0)
        found[1:-1] = far & (np.abs(values[2:] - values[:-2]) < 0.25 * np.abs(before))
    return found


def without_glitches(samples: Samples) -> Samples:
    """Leave out lone voltage samples that no cell can produce. Raises `BsaError` if there are many."""
    v, i = samples.voltage, samples.current
    if len(samples) < 3:
        return samples
    scale = float(np.max(np.abs(i)))
    calm = (np.abs(i[1:-1] - i[:-2]) <= 0.05 * scale) & (np.abs(i[1:-1] - i[2:]) <= 0.05 * scale)
    outside = (v[1:-1] < VOLTAGE_RANGE_V[0]) | (v[1:-1] > VOLTAGE_RANGE_V[1])
    bad = lone(v, GLITCH_V)
    bad[1:-1] &= calm | outside
    rows = np.flatnonzero(bad)
    if len(rows) == 0:
        return samples
    k = int(rows[0])
    if len(rows) > max(MISSING_ROWS, MISSING_SHARE * len(samples)):
        raise BsaError(
            f"{samples.source}: the voltage jumps for a single sample {counted(len(rows), 'time')}, first in "
            f"{samples.place(k)} ({v[k - 1]:g} V, {v[k]:g} V, {v[k + 1]:g} V).",
            "the sense wire may be loose; repair the record first.",
        )
    values = ", ".join(f"{v[row]:g} V" for row in rows[:5])
    glitches = f"{counted(len(rows), 'voltage glitch', 'es')} {were(len(rows))}"
    return samples.kept(~bad, f"{glitches} left out ({values} in {samples.places(rows)}).")


def check_range(samples: Samples) -> None:
    """Refuse voltages outside `VOLTAGE_RANGE_V`. Raises `BsaError` naming the first row and its value."""
    low, high = VOLTAGE_RANGE_V
    bad = np.flatnonzero((samples.voltage < low) | (samples.voltage > high))
    if len(bad):
        k = int(bad[0])
        raise BsaError(
            f"{samples.source}: {samples.place(k)}, column {samples.column('voltage')}: {samples.voltage[k]:g} V is no "
            f"voltage of a single cell ({low:g} to {high:g} V); {counted(len(bad), 'such row')}.",
            "repair or remove these rows.",
        )
