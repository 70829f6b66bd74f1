"""From the columns of a table, wherever it stands, to the signals of a cell."""

import shlex
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.printable import counted, listed, shown, were
from ...core.reading.clock import RESTART_S
from ...core.reading.samples import Extra, Samples
from ...core.record import ReadOptions
from ...core.trajectory import FloatArray
from .columns import EXTRA, AnyTable, Column, ambient_in, may_be_temperatures, named, resolve, unit_of
from .dates import clock_s, elapsed_s, exchanged, is_clock_or_date, is_date, is_of_days, seconds_of, since_first
from .impedance_columns import are_points, spectrum_columns
from .several_cells import refuse_several_cells, telling_cells
from .state_sign import NAMES as STATES
from .state_sign import with_signs
from .table import Numbers, first_filled, numbers_in

_COULOMB = ("c", "coulomb", "as", "a.s")
"""Units of a charge in ampere seconds, folded."""

_TAKEN = {"time": "s", "voltage": "V", "current": "A", "temperature": "degC"}


@dataclass(frozen=True)
class _Times:
    """What the columns of the time and of dates tell."""

    seconds: FloatArray  # Time of each sample, s; shape (n,).
    dates: Mapping[Extra, FloatArray]  # Of each sample, where there are any.
    day_first: bool | None  # Whether the day comes before the month in them; None where that is not told.
    notes: tuple[str, ...]


def read_table(table: AnyTable, options: ReadOptions, notes: Sequence[str] = ()) -> Samples:
    """Read the signals of a table. Raises `BsaError` naming the file, the row or column at fault and its value."""
    found = resolve(table, options)
    taken = {column.index for column in found.values()}
    places = _places_of_extra(table.header, taken)
    ambient, unknown = ambient_in(table)
    time = found["time"]
    in_words = is_clock_or_date(table.first(time.index))  # as 10:00:00, or as a date
    numeric = [column for column in found.values() if not (in_words and column is time)]
    cells = [] if options.join else telling_cells(table.header, {*taken, *places.values()})
    state = named(table.header, STATES) if "current" in found else None
    beside = [place for place in (state, ambient.index if ambient else None) if place is not None]
    impedance = spectrum_columns(table.header, {})
    of_spectra = [] if impedance is None else [impedance.frequency, impedance.first, impedance.second]
    texts = [*places.values(), *beside, *([time.index] if in_words else []), *cells, *of_spectra]
    read = table.numbers([column.index for column in numeric], options.where, texts)
    refuse_several_cells(table.header, {place: read.texts[place] for place in cells}, table.source)
    signals = {column.signal: column.in_si(read.values[column.index]) for column in numeric}
    extra = _extra(table, places, read)
    if ambient is not None:
        extra["ambient_k"] = kelvin(ambient, read.texts[ambient.index], table.decimal_comma)
    dates, texts_of_dates = extra.pop("date", None), read.texts.get(places.get("date", -1), ())
    told_times = read.texts[time.index] if in_words else signals["time"]
    times = _times(table.source, time, told_times, dates, texts_of_dates)
    extra |= times.dates
    if "current" not in signals:
        assert options.constant_current_a is not None
        signals["current"] = times.seconds * 0.0 + options.constant_current_a
    told: list[str] = []
    if state is not None:
        signed = with_signs(signals["current"], read.texts[state], options.current_sign == "discharge-positive")
        if signed is not None:
            signals["current"] = signed
            told = [f'the current has the sign of the state of each row (column "{shown(table.header[state])}").']
    samples = Samples(
        source=table.source,
        rows=read.rows,
        time=times.seconds,
        voltage=signals["voltage"],
        current=signals["current"],
        temperature=signals.get("temperature"),
        names={signal: shown(column.name) for signal, column in found.items()},
        tests_by=_tests_by(table, times.seconds, options) if not {"date", "cycle"} & set(extra) else None,
        without_unit=tuple(column.signal for column in numeric if column.unit is None),
        notes=(
            *notes,
            *read.notes,
            *([unknown] if unknown and options.ambient_c is None else []),
            *times.notes,
            *told,
            *_notes_on_units(numeric, options),
            *([] if "temperature" in found else _notes_on_temperatures(table, taken)),
            *_note_on_constant_current(found.get("current"), options),
        ),
        day_first=times.day_first,
        extra=extra,
    )
    return _without_spectra(samples, [numbers_in(read.texts[place], table.decimal_comma) for place in of_spectra])


def _without_spectra(samples: Samples, impedance: Sequence[FloatArray]) -> Samples:
    """The samples of a record between whose steps spectra were measured, without their rows.

    ``impedance`` is a frequency and both parts of an impedance in each row, where the table has such columns.
    """
    if not impedance:
        return samples
    frequency, first, second = impedance
    # Where a record has a frequency throughout, what has no impedance is no spectrum.
    of_spectra = are_points(frequency, first, second) & ((first != 0.0) | (second != 0.0))
    count = int(np.count_nonzero(of_spectra))
    if count in (0, len(samples)):
        return samples
    return samples.kept(~of_spectra, f"{counted(count, 'row')} of an impedance spectrum {were(count)} left out.")


def _places_of_extra(header: Sequence[str], taken: Container[int]) -> dict[Extra, int]:
    """Columns that say more than the signals do, besides those that are taken."""
    found = {name: named(header, names) for name, names in EXTRA.items()}
    return {name: place for name, place in found.items() if place is not None and place not in taken}


def _times(
    source: str,
    column: Column,
    told: FloatArray | Sequence[str],
    beside: FloatArray | None,
    texts_beside: Sequence[str],
) -> _Times:
    """What the column of the time tells in numbers or in words; ``beside`` are the dates of a column beside it."""
    notes: tuple[str, ...] = ()
    if not isinstance(told, np.ndarray):
        seconds, dates = elapsed_s(told, source, column.name, beside)
        first = first_filled(told)
        notes = (f'the time is that of column "{shown(column.name)}", which begins at {shown(first)}.',)
        if clock_s(first) is None:  # they are dates themselves
            beside, texts_beside = dates, told
        dates = beside if dates is None else dates
    elif is_date(told):  # seconds since 1970
        seconds, dates = since_first(told), told if beside is None else beside
    else:
        seconds, dates = told, beside
    if dates is None:
        return _Times(seconds, {}, None, notes)
    found: dict[Extra, FloatArray] = {"day" if is_of_days(dates) else "date": dates}
    day_first, other = exchanged(texts_beside)
    if other is not None:  # with the time of the day that a clock may have told
        found["other_date"] = other + (dates - (dates if beside is None else beside))
    return _Times(seconds, found, day_first, notes)


def _notes_on_units(columns: Sequence[Column], options: ReadOptions) -> Iterator[str]:
    """What is to be said of units that no column has, and of those that the options replace."""
    bare = [column for column in columns if column.unit is None]
    if bare:
        verb = "has no unit; it was" if len(bare) == 1 else "have no units; they were"
        taken_in = ", ".join(_TAKEN[column.signal] for column in bare)
        yield f"{listed(column.name for column in bare)} {verb} taken to be in {taken_in}."
    for column in columns:
        if column.written is not None:
            yield (
                f'column "{shown(column.name)}" was read in {options.units[column.signal]}, as said, not in '
                f"{shown(column.written)}, as the file has it."
            )


def _notes_on_temperatures(table: AnyTable, taken: Container[int]) -> Iterator[str]:
    """What is to be said of columns that may hold the cell's temperature, where none has a name that says so."""
    places = [
        k
        for k in may_be_temperatures(table.header, taken)
        if np.isfinite(numbers_in([table.first(k)], table.decimal_comma)).all()
    ]
    if places:
        names = [table.header[k] for k in places]
        which = shlex.quote(f"temperature={shown(names[0])}")
        yield f"no column is known to be the temperature of the cell; {listed(names)} may be (--column {which})."


def _note_on_constant_current(column: Column | None, options: ReadOptions) -> list[str]:
    """What is to be said of the current that the options give."""
    constant_a = options.constant_current_a
    if constant_a is None:
        return []
    if column is None:
        return [f"the file has no current; {constant_a:g} A was used throughout, as said."]
    return [
        f'the current of column "{shown(column.name)}" was used, not the constant {constant_a:g} A that was said: that '
        "is for a file without a current."
    ]


def _extra(table: AnyTable, places: Mapping[Extra, int], read: Numbers) -> dict[Extra, FloatArray]:
    """What can be read of the columns; one that is no number is no step, but nothing is wrong with the file."""
    found: dict[Extra, FloatArray] = {}
    for name, place in places.items():
        texts = read.texts[place]
        values = seconds_of(texts) if name == "date" else numbers_in(texts, table.decimal_comma)
        if values is None or not np.isfinite(values).any():
            continue
        found[name] = values / _per_ah(unit_of(table, place)) if name.endswith("_ah") else values
    return found


def _per_ah(unit: str | None) -> float:
    """How many of a unit of charge are an A.h, which is taken where the unit is not known."""
    folded = (unit or "").casefold()
    return 3600.0 if folded in _COULOMB else 1000.0 if folded.startswith("m") else 1.0


def _tests_by(table: AnyTable, time: FloatArray, options: ReadOptions) -> tuple[str, ...] | None:
    """The columns that have another value in each test of a file whose clock restarts, with that of the first one."""
    with np.errstate(invalid="ignore"):
        begins = np.flatnonzero(np.diff(time) < -RESTART_S) + 1
    return None if len(begins) == 0 or options.join else told_apart_by(table, options, begins)


def told_apart_by(
    table: AnyTable, options: ReadOptions, begins: NDArray[np.intp], rows: NDArray[np.intp] | None = None
) -> tuple[str, ...]:
    """The columns with another value from each of these rows on, as ``COLUMN=VALUE`` of what stands before the first.

    ``rows`` are those that count; left out, all that the options keep.
    """
    found = []
    for place, name in enumerate(table.header):
        cells = table.numbers([], options.where, [place]).texts[place]
        if rows is not None:
            cells = [cells[row] for row in rows]
        changes = [k for k, (one, two) in enumerate(pairwise(cells), 1) if one != two]
        if changes == begins.tolist() and len({cells[k] for k in changes} | {cells[0]}) == len(changes) + 1:
            found.append(shlex.quote(f"{shown(name)}={shown(cells[0].strip())}"))
    return tuple(found)


def kelvin(column: Column, texts: Sequence[str], decimal_comma: bool) -> FloatArray:
    """A column of temperatures in K; NaN where a cell holds none."""
    values = numbers_in(texts, decimal_comma)
    return column.in_si(np.where(np.abs(values) < 1e3, values, np.nan))
