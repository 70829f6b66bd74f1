"""What a record or a spectrum holds, in plain lines of at most 80 characters."""

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TypeVar

import numpy as np
from scipy.constants import zero_Celsius

from ...core.printable import counted, rounded
from ...core.reading.summary import RecordSummary, ResistanceRow, StepRow
from ...core.record import Record
from ...core.spectrum import ImpedanceSpectrum
from .signs import positive_on_charge

WIDTH = 80

QUICK_S = 1.5
"""A resistance seen within this time of the switch is mostly ohmic and kinetic, in s."""

ROWS = 16
"""Rows of a table at most; of a longer one the first and the last are shown."""

_Row = TypeVar("_Row")


def duration(seconds: float) -> str:
    """A length of time in the unit that suits it: ``12.3 h``; less than any instrument tells apart is ``<0.1 ms``."""
    if 0.0 < abs(seconds) < 1e-4:
        return "<0.1 ms"
    for limit, size, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (200 * 3600.0, 3600.0, "h")):
        if abs(seconds) < limit:
            return f"{seconds / size:.4g} {unit}"
    return f"{seconds / 86400.0:.4g} d"


def size_of(record: Record) -> dict[str, float]:
    """Samples, seconds and cycles of a record."""
    trajectory = record.trajectory
    return {"samples": len(trajectory), "duration_s": trajectory.duration, "cycles": len(trajectory.cycles)}


def listed_share(whole: Record | ImpedanceSpectrum, parts: Sequence[Record | ImpedanceSpectrum]) -> str:
    """How much of a file its parts are, which is what is listed; empty where they are all of it."""
    records = [size_of(part) for part in parts if isinstance(part, Record)]
    if not isinstance(whole, Record) or (len(records) == 1 and records[0] == size_of(whole)):
        return ""
    cycles = {number for part in parts if isinstance(part, Record) for number in part.trajectory.cycles}
    samples, seconds = (sum(one[name] for one in records) for name in ("samples", "duration_s"))
    all_of_it = whole.trajectory
    return (
        f"{samples:,} of {len(all_of_it):,} samples ({duration(seconds)} of {duration(all_of_it.duration)}, "
        f"{len(cycles):,} of {counted(len(all_of_it.cycles), 'cycle')}) are listed, in "
        f"{counted(len(records), 'part')}, as a calibration uses them"
    )


def record_lines(found: RecordSummary) -> Iterator[str]:
    """A record: what was measured, its steps, cycles, resistances and slow curves, and what is wrong with it.

    Current is positive on charge here, as in the files of cyclers.
    """
    found = positive_on_charge(found)
    yield found.name
    least, usual, most = found.interval_s
    yield f"  {found.samples:,} samples over {duration(found.duration_s)}, one in {duration(usual)}" + (
        f" ({duration(least)} to {duration(most)})" if most > 1.5 * least else ""
    )
    yield f"  voltage      {found.voltage[0]:.3f} to {found.voltage[1]:.3f} V"
    yield f"  current      {found.current[0]:+.4g} to {found.current[1]:+.4g} A (positive on charge)"
    if found.temperature_c is None:
        yield "  temperature  not measured"
    else:
        first, low, high = found.temperature_c
        yield f"  temperature  {first:.1f} degC at first, {low:.1f} to {high:.1f} degC"
    if found.ambient_c is not None:
        yield f"  ambient      {found.ambient_c:.1f} degC"
    yield from _table(
        f"Steps ({len(found.steps)})",
        "  cycle  step            start   duration  current A    A.h in   from V    to V",
        found.steps,
        partial(_step_line, decimals=_decimals(row.charge_ah for row in found.steps)),
    )
    if len(found.cycles) > 1:
        decimals = _decimals(charge for row in found.cycles for charge in (row.charged_ah, row.discharged_ah))
        yield from _table(
            f"Cycles ({len(found.cycles)})",
            "  cycle  charged A.h  discharged A.h  warmest degC",
            found.cycles,
            lambda row: (
                f"  {row.cycle:5d}  {row.charged_ah:11.{decimals}f}  {row.discharged_ah:14.{decimals}f}"
                + ("" if row.warmest_c is None else f"  {row.warmest_c:12.1f}")
            ),
        )
    if found.resistances:
        quick = [1e3 * row.ohm for row in found.resistances if row.after_s <= QUICK_S]
        median = (
            f"; median of {len(quick)} seen within {QUICK_S:g} s: {_mohm(float(np.median(quick)))} mohm"
            if quick
            else ""
        )
        yield from _table(
            f"Resistance where the current switches ({len(found.resistances)}{median})",
            "       time  voltage V  current step A  seen after     mohm",
            found.resistances,
            _resistance_line,
        )
        if len(quick) < len(found.resistances):
            yield f"  What is seen after more than {QUICK_S:g} s holds slower processes too."
    for curve in found.slow:
        yield ""
        yield f"Slow {curve.kind}, nearly an open-circuit curve"
        rate = f"{curve.hours:.0f}" if curve.hours > 100 else f"{curve.hours:.3g}"
        yield (
            f"  C/{rate} from {duration(curve.start_s)} on, {curve.charge_ah:.{_decimals([curve.charge_ah])}f} A.h"
            f" from {curve.first_v:.3f} to {curve.last_v:.3f} V"
        )
    if found.rests:
        decimals = _decimals(row.charge_ah for row in found.rests)
        yield from _table(
            f"Voltage at the end of long rests ({len(found.rests)}), an open-circuit curve",
            "       time  drawn A.h  voltage V",
            found.rests,
            lambda row: f"  {duration(row.time_s):>9s}  {row.charge_ah:9.{decimals}f}  {row.voltage:9.3f}",
        )
    yield from problem_lines(found.problems)


def spectrum_lines(found: ImpedanceSpectrum) -> Iterator[str]:
    """An impedance spectrum: its range, its resistance on the real axis, and what was assumed."""
    yield found.name
    highest, lowest = (rounded(found.frequency[k], 4) for k in (0, -1))
    yield f"  impedance spectrum, {len(found)} points, {highest} to {lowest} Hz"
    if found.voltage is not None:
        yield f"  voltage      {found.voltage:.3f} V"
    if found.temperature_k is not None:
        yield f"  temperature  {found.temperature_k - zero_Celsius:.1f} degC"
    ohmic = found.ohmic_resistance
    if ohmic is not None:
        yield f"  ohmic        {1e3 * ohmic:.2f} mohm, where the imaginary part is zero"
    for k in (0, len(found) - 1):
        z = 1e3 * found.impedance[k]
        yield f"  at {f'{rounded(found.frequency[k], 4)} Hz':<13s}{z.real:.2f} {z.imag:+.2f}j mohm"
    yield from problem_lines(found.notes)


def problem_lines(problems: Sequence[str]) -> Iterator[str]:
    """What was assumed, repaired or cannot be trusted; a line if there is nothing."""
    yield ""
    yield f"Noted ({len(problems)})" if problems else "Nothing was assumed, repaired or missing."
    for problem in problems:
        yield from wrapped(problem, "  - ")


def _table(title: str, header: str, rows: Sequence[_Row], line: Callable[[_Row], str]) -> Iterator[str]:
    yield ""
    yield title
    yield header
    if len(rows) <= ROWS:
        yield from map(line, rows)
        return
    yield from map(line, rows[: ROWS - 4])
    yield f"  ... {len(rows) - ROWS:,} more (--json has all) ..."
    yield from map(line, rows[-4:])


def _decimals(charges_ah: Iterable[float]) -> int:
    """Decimals of a column of charges: four, or so many that the largest one has four digits."""
    largest = max(map(abs, charges_ah), default=0.0)
    return 4 if largest == 0.0 else max(4, 3 - math.floor(math.log10(largest)))


def _mohm(value: float) -> str:
    """A resistance in mohm with as many digits as a measurement has."""
    if value < 10.0:
        return f"{value:.3g}"
    return f"{value:.1f}" if value < 1000.0 else f"{float(f'{value:.4g}'):.0f}"


def _step_line(row: StepRow, decimals: int) -> str:
    return (
        f"  {row.cycle:5d}  {row.kind:12s} {duration(row.start_s):>8s}  {duration(row.duration_s):>9s}"
        f"  {row.current_a:+9.4g} {row.charge_ah:+9.{decimals}f}  {row.first_v:7.3f} {row.last_v:7.3f}"
    )


def _resistance_line(row: ResistanceRow) -> str:
    return (
        f"  {duration(row.time_s):>9s}  {row.voltage:9.3f}  {row.current_change_a:+14.4g}"
        f"  {duration(row.after_s):>10s}  {_mohm(1e3 * row.ohm):>7s}"
    )


def wrapped(text: str, indent: str = "") -> Iterable[str]:
    """The text in lines of `WIDTH`, the later ones as far in as the first."""
    # An option or a file's name that is broken cannot be copied.
    return textwrap.wrap(
        text, WIDTH, initial_indent=indent, subsequent_indent=" " * len(indent), break_on_hyphens=False
    )
