"""Impedance spectra: Digatron, BioLogic and any table of frequency with real and imaginary part, or |Z| and phase."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, Field
from scipy.constants import zero_Celsius

from ...core.errors import BsaError
from ...core.printable import counted, listed, shown, were
from ...core.reading.clock import choice_of
from ...core.reading.samples import Mask
from ...core.record import ReadOptions
from ...core.spectrum import ImpedanceSpectrum
from ...core.trajectory import FloatArray
from .assembly import kelvin, told_apart_by
from .columns import NAMES, AnyTable, Column, ambient_in, half_cell, named, unit_of
from .gamry import gamry_spectrum, is_gamry_s
from .impedance_columns import SpectrumColumns, are_points, base_of, is_of_a_record, spectrum_columns
from .source import first_lines, is_text_table, load_text
from .table import Numbers, find_table, no_column, numbers_in, split

_HEAD_LINES = 120
"""First lines of a file, among which the names of a spectrum's columns are looked for."""

_SEPARATORS = ";\t,"

_MIN_POINTS = 5
"""A spectrum of fewer points is refused."""

_OHM: Mapping[str, float] = {
    **dict.fromkeys(["ohm", "ohms", "ω"], 1.0),
    **dict.fromkeys(["mohm", "mohms", "mω", "milliohm"], 1e-3),
    **dict.fromkeys(["kohm", "kohms", "kω", "kiloohm"], 1e3),
}
_HERTZ: Mapping[str, float] = {"hz": 1.0, "hertz": 1.0, "1/s": 1.0, "mhz": 1e-3, "khz": 1e3, "Mhz": 1e6}
_ANGULAR = re.compile(r"rad\b|omega|ω", re.IGNORECASE)
"""What the name or the unit of an angular frequency holds."""

_RADIANS: Mapping[str, float] = {
    **dict.fromkeys(["deg", "degree", "degrees", "°"], np.pi / 180.0),
    **dict.fromkeys(["rad", "radian", "radians"], 1.0),
}
_DIGATRON = "zreal1"
"""Digatron writes milliohm under this name, and no unit."""

_NO_UNIT = "eis"
"""What Digatron writes beneath the columns of a spectrum, where units stand."""


class ImpedanceOptions(BaseModel, extra="forbid", frozen=True):
    """What the header does not say."""

    unit: Literal["ohm", "mohm"] | None = Field(
        default=None, description="Unit of the impedance, in place of the header's."
    )


class ImpedanceCsv:
    """Reads a frequency with a real and an imaginary part, or a magnitude and a phase, from a text table.

    Columns are recognised by common names, or said with ``columns``. ``-Im(Z)`` and ``-Z''`` are turned, and so is an
    imaginary part that is positive at the lowest frequency, where every cell is capacitive.
    """

    def __init__(self, options: ImpedanceOptions) -> None:
        self._unit = options.unit

    def matches(self, path: Path) -> bool:
        """Whether a line near the top names the columns of a spectrum, and those below it are no record's.

        Of Gamry's files, whose spectrum stands far below, whether there is one.
        """
        lines = first_lines(path, _HEAD_LINES) if is_text_table(path) else []
        if is_gamry_s("".join(lines[:1])):
            return gamry_spectrum(load_text(path)[0], path.name) is not None
        for (place, line), separator in product(enumerate(lines), _SEPARATORS):
            header = split(line, separator)
            columns = spectrum_columns(header, {})
            if columns is not None:
                rows = [split(row, separator) for row in lines[place + 1 :]]
                cells = [row[columns.frequency] for row in rows if len(row) > columns.frequency]
                return not is_of_a_record(header, numbers_in(cells, decimal_comma=True))
        return False

    def read(self, path: Path, options: ReadOptions) -> ImpedanceSpectrum:
        """Read the spectrum; see `Reader.read`."""
        text, notes = load_text(path)
        source = shown(path.name)
        return spectrum_of(gamry_spectrum(text, source) or find_table(text, source), options, self._unit, notes)


def spectrum_of(
    table: AnyTable, options: ReadOptions, unit: str | None = None, notes: Sequence[str] = ()
) -> ImpedanceSpectrum:
    """Read the spectrum of a table.

    Rows without three numbers are left out, and those that the options do not keep; ``unit``, ohm or mohm, is taken in
    place of the header's. Raises `BsaError` if a column or its unit cannot be told, fewer than five points are left, or
    they are those of several spectra.
    """
    columns = _columns_of(table, options)
    voltage = None if half_cell(table.header) else named(table.header, NAMES["voltage"])
    ambient, unknown = ambient_in(table)
    wanted = [columns.frequency, columns.first, columns.second]
    beside = [voltage, None if ambient is None else ambient.index]
    read = table.numbers([], options.where, [*wanted, *(place for place in beside if place is not None)])
    frequency, first, second = (numbers_in(read.texts[place], table.decimal_comma) for place in wanted)
    kept = are_points(frequency, first, second)
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
    scale, note = _ohms(table, columns.first, unit)
    sign = -1.0 if columns.turned else 1.0
    if columns.polar:
        radians, of_phase = _radians(table, columns.second)
        impedance = scale * first[kept] * np.exp(1j * sign * radians * second[kept])
        note += of_phase
    else:
        own = unit is None and _unit(table, columns.second) is not None
        other = _ohms(table, columns.second, None)[0] if own else scale
        impedance = np.asarray(scale * first[kept] + 1j * sign * other * second[kept], dtype=np.complex128)
    if impedance.imag[np.argmin(frequency[kept])] > 0:
        impedance = impedance.conj()
        said.append("the imaginary part is positive at the lowest frequency; it was taken to be -Im(Z) and turned.")
    rest = None
    if voltage is not None:
        unit_v = unit_of(table, voltage)
        column = Column("voltage", voltage, table.header[voltage], None if unit_v is None else unit_v.casefold())
        if column.has_known_unit:
            rest = _median(column.in_si(numbers_in(read.texts[voltage], table.decimal_comma)))
        else:
            said.append(f'the unit of "{shown(column.name)}" is not known, and neither is the rest voltage.')
    around = None if ambient is None else _first(kelvin(ambient, read.texts[ambient.index], table.decimal_comma))
    if options.ambient_c is not None:
        around = options.ambient_c + zero_Celsius
    return ImpedanceSpectrum(
        table.source,
        frequency[kept],
        impedance,
        voltage=rest,
        temperature_k=around,
        notes=(*said, *note),
    )


def _columns_of(table: AnyTable, options: ReadOptions) -> SpectrumColumns:
    """The columns of a table's spectrum. Raises `BsaError` if one is not there or cannot be told."""
    said = options.impedance_columns
    for name in said.values():
        if name not in table.header:
            raise no_column(name, table.header, table.source)
    found = spectrum_columns(table.header, said)
    if found is None:
        raise BsaError(
            f"{table.source} has no columns for frequency with real and imaginary impedance, or with magnitude and "
            f"phase: {listed(table.header)}.",
            "say which with --column frequency=NAME --column real=NAME --column imaginary=NAME (or magnitude and phase "
            "in place of these two).",
        )
    return found


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
    taken = "mohm" if base_of(name) == _DIGATRON else "ohm"
    note = (
        f'"{shown(name)}" has no unit of impedance; it was taken to be in {taken} (--reader-option unit=ohm or mohm).'
    )
    return _OHM[taken], (note,)


def _hertz(table: AnyTable, place: int) -> float:
    """The size of the unit of frequency in Hz. Raises `BsaError` if it is not known."""
    unit = _unit(table, place) or "Hz"
    if _ANGULAR.search(table.header[place]) or _ANGULAR.search(unit):
        return 0.5 / np.pi
    # A capital M is mega, a small one milli.
    folded = "M" + unit[1:].casefold() if unit.startswith("M") else unit.casefold()
    if folded not in _HERTZ:
        raise _unknown_unit(table, table.header[place], unit, "frequency", "give it in Hz, and name it Frequency [Hz].")
    return _HERTZ[folded]


def _radians(table: AnyTable, place: int) -> tuple[float, tuple[str, ...]]:
    """The size of the unit of phase in radians, and a note if it was assumed. Raises `BsaError` if it is not known."""
    name, unit = table.header[place], _unit(table, place)
    if unit is None:
        return _RADIANS["deg"], (f'"{shown(name)}" has no unit; it was taken to be in degrees.',)
    if unit.casefold() not in _RADIANS:
        raise _unknown_unit(table, name, unit, "phase", "give it in degrees, and name it Phase [deg].")
    return _RADIANS[unit.casefold()], ()


def _unit(table: AnyTable, place: int) -> str | None:
    unit = unit_of(table, place)
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
