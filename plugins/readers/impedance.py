"""Impedance spectra: Digatron, BioLogic and any table of frequency, real and imaginary part."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, Field

from ...core.errors import BsaError
from ...core.printable import counted, listed, shown, were
from ...core.reading.clock import choice_of
from ...core.reading.samples import Mask
from ...core.record import ReadOptions
from ...core.spectrum import ImpedanceSpectrum
from ...core.trajectory import FloatArray
from .assembly import AnyTable, kelvin, numbers, told_apart_by
from .columns import NAMES, ambient_in, half_cell, named, split_name, unit_of
from .generic_csv import first_lines, is_text_table
from .source import load_text
from .table import Numbers, find_table

_HEAD_LINES = 120
_MIN_POINTS = 5

_PARTS: Mapping[str, tuple[str, ...]] = {
    "frequency": ("actfreq", "freq", "frequency", "f"),
    "real": ("zreal", "zreal1", "zre", "rez", "re", "real"),
    "imaginary": ("zimag", "zimg", "zimg1", "zimag1", "zim", "imz", "im", "imag", "imaginary"),
}
_OHM: Mapping[str, float] = {
    **dict.fromkeys(["ohm", "ohms", "ω"], 1.0),
    **dict.fromkeys(["mohm", "mohms", "mω", "milliohm"], 1e-3),
    **dict.fromkeys(["kohm", "kohms", "kω", "kiloohm"], 1e3),
}
_HERTZ: Mapping[str, float] = {"hz": 1.0, "hertz": 1.0, "1/s": 1.0, "mhz": 1e-3, "khz": 1e3, "Mhz": 1e6}
_DIGATRON = "zreal1"
"""Digatron writes milliohm under this name, and no unit."""

_NO_UNIT = "eis"
"""What Digatron writes beneath the columns of a spectrum, where units stand."""


class ImpedanceOptions(BaseModel, extra="forbid", frozen=True):
    """What the header does not say."""

    unit: Literal["ohm", "mohm"] | None = Field(
        default=None, description="Unit of the impedance, in place of the header's."
    )


@dataclass(frozen=True)
class _Columns:
    """Places of the three columns, and whether the imaginary part is written with its sign turned."""

    frequency: int
    real: int
    imaginary: int
    turned: bool


class ImpedanceCsv:
    """Reads a frequency, a real and an imaginary part from a text table.

    ``-Im(Z)`` and ``-Z''`` are turned, and so is an imaginary part that is positive at the lowest frequency, where
    every cell is capacitive.
    """

    def __init__(self, options: ImpedanceOptions) -> None:
        self._unit = options.unit

    def matches(self, path: Path) -> bool:
        """Whether a line near the top names a frequency, a real and an imaginary part."""
        return is_text_table(path) and any(
            holds_spectrum(re.split("[;,\t]", line)) for line in first_lines(path, _HEAD_LINES)
        )

    def read(self, path: Path, options: ReadOptions) -> ImpedanceSpectrum:
        """Read the spectrum; see `Reader.read`."""
        text, notes = load_text(path)
        return spectrum_of(find_table(text, shown(path.name)), options, self._unit, notes)


def holds_spectrum(header: Sequence[str]) -> bool:
    """Whether the columns are those of an impedance spectrum."""
    return _columns(header) is not None


def spectrum_of(
    table: AnyTable, options: ReadOptions, unit: str | None = None, notes: Sequence[str] = ()
) -> ImpedanceSpectrum:
    """Read the spectrum of a table.

    Rows without three numbers are left out, and those that the options do not keep; ``unit``, ohm or mohm, is taken in
    place of the header's. Raises `BsaError` if a column or its unit cannot be told, fewer than five points are left, or
    they are those of several spectra.
    """
    columns = _columns(table.header)
    if columns is None:
        raise BsaError(
            f"{table.source} has no columns for frequency, real and imaginary impedance: {listed(table.header)}.",
            "name them Frequency [Hz], Zreal [ohm] and Zimag [ohm].",
        )
    voltage = None if half_cell(table.header) else named(table.header, NAMES["voltage"])
    ambient, unknown = ambient_in(table.header, table.units)
    wanted = [columns.frequency, columns.real, columns.imaginary]
    beside = [voltage, None if ambient is None else ambient.index]
    read = table.numbers({}, options.where, [*wanted, *(place for place in beside if place is not None)])
    frequency, real, imaginary = (numbers(read.texts[place], True) for place in wanted)
    kept = np.isfinite(frequency) & np.isfinite(real) & np.isfinite(imaginary) & (frequency > 0)
    said = [*notes, *read.notes]
    if unknown and options.ambient_c is None:
        said.append(unknown)
    if not kept.all():
        gone = int(np.count_nonzero(~kept))
        said.append(f"{counted(gone, 'row')} without a frequency and an impedance {were(gone)} left out.")
    if np.count_nonzero(kept) < _MIN_POINTS:
        raise BsaError(
            f"{table.source} has {np.count_nonzero(kept)} points of impedance; at least {_MIN_POINTS} are needed.",
            "give the whole spectrum.",
        )
    frequency = frequency * _hertz(table, columns.frequency)
    _check_sweep(table, options, read, frequency, kept)
    scale, note = _ohms(table, columns.real, unit)
    sign = -1.0 if columns.turned else 1.0
    impedance = scale * np.asarray(real[kept] + 1j * sign * imaginary[kept], dtype=np.complex128)
    if impedance.imag[np.argmin(frequency[kept])] > 0:
        impedance = impedance.conj()
        said.append("the imaginary part is positive at the lowest frequency; it was taken to be -Im(Z) and turned.")
    rest = None if voltage is None else _median(numbers(read.texts[voltage], True))
    around = None if ambient is None else _first(kelvin(ambient, read.texts[ambient.index], True))
    if options.ambient_c is not None:
        around = options.ambient_c + 273.15
    return ImpedanceSpectrum(
        table.source,
        frequency[kept],
        impedance,
        voltage=rest,
        temperature_k=around,
        notes=(*said, *note),
    )


def _columns(header: Sequence[str]) -> _Columns | None:
    bases = [_base(name) for name in header]
    places = {
        part: next((bases.index(name) for name in names if name in bases), None) for part, names in _PARTS.items()
    }
    frequency, real, imaginary = places["frequency"], places["real"], places["imaginary"]
    if frequency is None or real is None or imaginary is None:
        return None
    return _Columns(frequency, real, imaginary, header[imaginary].strip().startswith("-"))


def _base(name: str) -> str:
    """The name without its unit and sign; Z' is the real part, Z'' the imaginary one."""
    spelt = name.replace("''", "imag").replace('"', "imag").replace("'", "real")
    return split_name(spelt.strip())[0]


def _check_sweep(table: AnyTable, options: ReadOptions, read: Numbers, frequency: FloatArray, kept: Mask) -> None:
    """Raise `BsaError` unless the frequency rises from point to point, or falls: else there are several spectra."""
    rows = np.flatnonzero(kept)
    ways = np.sign(np.diff(frequency[rows]))
    onwards = 1.0 if np.sum(ways) > 0 else -1.0
    begins = np.flatnonzero(ways != onwards) + 1
    if len(begins) == 0:
        return
    before, after = rows[begins[0] - 1], rows[begins[0]]
    raise BsaError(
        f"{table.source} holds more than one impedance spectrum: the frequency {'rises' if onwards > 0 else 'falls'}, "
        f"but goes from {frequency[before]:g} to {frequency[after]:g} Hz in row {read.rows[after]}.",
        f"{choice_of(told_apart_by(table, options, begins, rows))}.",
    )


def _ohms(table: AnyTable, place: int, said: str | None) -> tuple[float, tuple[str, ...]]:
    """The size of the unit in ohm, and a note if it was assumed. Raises `BsaError` if the unit is not known."""
    name = table.header[place]
    unit = said or _unit(table, place)
    if unit is not None:
        if unit.casefold() not in _OHM:
            raise _unknown_unit(table, name, unit, "impedance", "say --reader-option unit=ohm or mohm.")
        return _OHM[unit.casefold()], ()
    taken = "mohm" if _base(name) == _DIGATRON else "ohm"
    note = (
        f'"{shown(name)}" has no unit of impedance; it was taken to be in {taken} (--reader-option unit=ohm or mohm).'
    )
    return _OHM[taken], (note,)


def _hertz(table: AnyTable, place: int) -> float:
    """The size of the unit of frequency in Hz. Raises `BsaError` if it is not known."""
    unit = _unit(table, place) or "Hz"
    # A capital M is mega, a small one milli.
    folded = "M" + unit[1:].casefold() if unit.startswith("M") else unit.casefold()
    if folded not in _HERTZ:
        raise _unknown_unit(table, table.header[place], unit, "frequency", "give it in Hz, and name it Frequency [Hz].")
    return _HERTZ[folded]


def _unit(table: AnyTable, place: int) -> str | None:
    unit = unit_of(table.header, table.units, place)
    return None if unit is None or unit.casefold() == _NO_UNIT else unit


def _unknown_unit(table: AnyTable, name: str, unit: str, of: str, hint: str) -> BsaError:
    return BsaError(
        f'{table.source}: column "{shown(name)}" has the unit "{shown(unit)}", which is no unit of {of} that is known.',
        hint,
    )


def _median(values: FloatArray) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else None


def _first(values: FloatArray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known[0]) if len(known) else None
