"""Which column is which signal, and in which unit."""

import re
import unicodedata
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from scipy.constants import zero_Celsius

from ...core.errors import BsaError
from ...core.printable import listed, shown
from ...core.reading.samples import Extra
from ...core.record import ReadOptions, Signal
from ...core.trajectory import FloatArray
from .arrays import ArrayTable
from .table import Table, no_column

AnyTable = Table | ArrayTable
"""A table of any kind of file."""

SIGNALS: tuple[Signal, ...] = get_args(Signal)

_ZERO_C_IN_F = 32.0
_KELVIN = ("k", "kelvin")
_FAHRENHEIT = ("degf", "°f", "f", "fahrenheit", "deg f", "degreefahrenheit", "degree_fahrenheit")

_FACTORS: Mapping[Signal, Mapping[str, float]] = {
    "time": {
        **dict.fromkeys(["s", "sec", "secs", "second", "seconds", "ss.xxx"], 1.0),
        **dict.fromkeys(["ms", "millisecond", "milliseconds"], 1e-3),
        **dict.fromkeys(["min", "mins", "minute", "minutes"], 60.0),
        **dict.fromkeys(["h", "hr", "hrs", "hour", "hours"], 3600.0),
        **dict.fromkeys(["d", "day", "days"], 86400.0),
    },
    "voltage": {**dict.fromkeys(["v", "volt", "volts"], 1.0), **dict.fromkeys(["mv", "millivolt", "millivolts"], 1e-3)},
    "current": {
        **dict.fromkeys(["a", "amp", "amps", "ampere", "amperes"], 1.0),
        **dict.fromkeys(["ma", "milliamp", "milliamps", "milliampere"], 1e-3),
        **dict.fromkeys(["ua", "μa", "microamp", "microamps", "microampere"], 1e-6),
    },
    "temperature": {
        **dict.fromkeys(["degc", "°c", "c", "celsius", "deg c", "degreecelsius", "degree_celsius", "dc", "t1"], 1.0),
        **dict.fromkeys(_KELVIN, 1.0),
        **dict.fromkeys(_FAHRENHEIT, 5.0 / 9.0),
    },
}
_OTHERS = ("ah", "mah", "hz", "khz", "ohm", "ohms", "mohm", "deg", "degree", "degrees", "rad")
"""Units of charge, frequency, impedance and phase that may end a name: ``Charge_Capacity_Ah``, ``Z_Real_Ohm``."""

_OFFERED: Mapping[Signal, str] = {
    "time": "s, ms, min, h or d",
    "voltage": "V or mV",
    "current": "A, mA or uA",
    "temperature": "degC, K or degF",
}

NAMES: Mapping[Signal, tuple[str, ...]] = {
    "time": (
        *("testtime", "progtime", "totaltime", "cumulativetime", "elapsedtime", "time", "timevec", "runtime", "t"),
        *("testzeit", "prüfzeit", "laufzeit", "zeit", "temps", "测试时间", "总时间", "时间"),
    ),
    "voltage": (
        *("voltage", "cellvoltage", "voltagemeasured", "terminalvoltage", "ecell", "eweece"),
        *("ewe", "potential", "volvec", "vraw", "u", "v"),
        *("zellspannung", "spannung", "tension", "电压"),
    ),
    "current": ("current", "cur", "currentmeasured", "cellcurrent", "currvec", "iraw", "i", "strom", "courant", "电流"),
    "temperature": (
        *("celltemperature", "tcell", "surfacetemperature", "temperaturet1", "surfacetemperaturet1", "temperature"),
        *("temperaturemeasured", "auxtemperature1", "temperature1", "temp", "celltempmid", "celltemppos"),
        *("logtempmid", "logtemppositive", "logtemp001", "batterytemp", "casetemperature"),
        *("t1", "t"),
        *("zelltemperatur", "temperatur", "température", "温度"),
    ),
}
"""Names of the signals' columns, folded to lower-case letters and digits, in order of preference: in English, and in
the German, French and Chinese of cyclers that write these."""

AMBIENT = ("ambienttemperature", "chambertemp", "chambertemperature", "chambert")
"""Names of a column with the temperature around the cell."""

EXTRA: Mapping[Extra, tuple[str, ...]] = {
    "step": ("stepcount", "stepindex", "step", "stepid", "stepnumber", "stepno", "ns", "schritt", "工步号"),
    "cycle": ("cyclecount", "cycleindex", "cycle", "cyclenumber", "cycleno", "cycleid", "zyklus", "循环号"),
    "date": (
        *("unixtime", "datetime", "timestamp", "date", "absolutetime", "datum", "datumzeit", "datumuhrzeit"),
        *("dateheure", "日期时间", "日期"),
    ),
    "net_ah": ("netcapacity", "ah", "ahaccu", "qqo"),
    "charged_ah": ("chargingcapacity", "chargecapacity", "qcharge"),
    "discharged_ah": ("dischargingcapacity", "dischargecapacity", "qdischarge"),
}
"""Names of the columns that say more than the signals do; folded, in order of preference."""

_UNIT_NAMES: Mapping[Signal, tuple[str, ...]] = {
    signal: tuple(unit for unit in units if unit.isalpha() and len(unit) > 3) for signal, units in _FACTORS.items()
}
"""Units in words, which stand for the signal where no column has a name of it: ``Seconds``, ``Amps``, ``Volts``. A
shorter one may be anything."""

_CAPACITIES = ("capacity", "dischargecapacity", "chargecapacity", "discapacity", "qd", "qc", "soh", "容量")
"""How the names of columns with a capacity begin, folded."""

_CLOCKS = ("time", "zeit", "uhrzeit", "heure", "时间")
"""What stands behind a date and a slash, and is no unit: ``Datum/Zeit``."""

_TWO_MEANINGS = ("t", "t1")
"""Short names that are a temperature with a unit of temperature alone: ``t/s`` is a time, ``T/°C`` a temperature."""

_WORKING, _COUNTER = "ewe", "ece"
"""Potentials of the working and of the counter electrode against a reference electrode (BioLogic); without a reference
electrode, that of the working electrode is the cell's voltage."""

_BRACKETS = re.compile(r"^(?P<base>.*?)\s*[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])]\s*(?P<tail>_?\d*)$")
_SLASH = re.compile(r"^(?P<base>.*?)\s*(?:/|#(?=[A-Za-z]))\s*(?P<unit>[^/#]*)$")
_SUFFIX = re.compile(r"^(?P<base>.+)[_ ](?P<unit>[A-Za-z]+)$")


_LIKE_A_TEMPERATURE = re.compile(r"(aux|cell|surface|log|measured)?temp(erature)?\w{0,3}$")
"""Names of temperatures that may be the cell's or another one: ``Temp 13``, ``AuxTemp``, ``temp1_1``; folded."""


@dataclass(frozen=True)
class Column:
    """One signal's column."""

    signal: Signal  # What it holds.
    index: int  # Place in the table, from 0.
    name: str  # Name in the file.
    unit: str | None  # Unit as written or said, folded to lower case; None where there is none.
    written: str | None = None  # Unit that the file has, where a person says another one.

    @property
    def has_known_unit(self) -> bool:
        """Whether `in_si` knows its unit."""
        return not self.unit or self.unit in _FACTORS[self.signal]

    def in_si(self, values: FloatArray) -> FloatArray:
        """Values in s, V, A or K; without a unit they are taken to be in s, V, A or degC."""
        if self.unit in _KELVIN:
            return values
        factor = _FACTORS[self.signal][self.unit] if self.unit else 1.0
        if self.signal == "temperature":
            zero = _ZERO_C_IN_F if self.unit in _FAHRENHEIT else 0.0
            return np.asarray((values - zero) * factor + zero_Celsius)
        # Dividing by a round number keeps 3700 mV exactly 3.7 V.
        with np.errstate(over="ignore"):  # an infinite number is refused by its row
            return values / round(1.0 / factor) if factor < 1.0 else values * factor


def split_name(name: str) -> tuple[str, str | None]:
    """A column's name without its unit, folded to letters and digits, and the unit as written.

    Understands ``Voltage / V``, ``Voltage#V``, ``U[V]``, ``Current(A)``, ``voltage_V``, ``test_time_second`` and
    ``Volts``.
    """
    # The patterns take quadratic time, which a name of a megabyte could abuse. Brackets and units may be full-width.
    name = unicodedata.normalize("NFKC", name[:200])
    name = name[1:-1] if name.startswith("<") and name.endswith(">") else name  # ``<Ewe/V>``
    bracketed = _BRACKETS.match(name)
    if bracketed and bracketed["base"]:
        return _folded(bracketed["base"] + bracketed["tail"]), bracketed["unit"] or None
    slashed = _SLASH.match(name)
    if slashed and slashed["base"] and slashed["unit"].casefold() not in _CLOCKS:
        return _folded(slashed["base"]), slashed["unit"].strip() or None
    suffixed = _SUFFIX.match(name)
    if suffixed and any(suffixed["unit"].casefold() in units for units in (*_FACTORS.values(), _OTHERS)):
        return _folded(suffixed["base"]), suffixed["unit"]
    folded = _folded(name)
    return folded, name.strip() if any(folded in units for units in _UNIT_NAMES.values()) else None


def _folded(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def signal_of(name: str) -> Signal | None:
    """The signal that a column's name suggests."""
    base, unit = split_name(name)
    named_so = (signal for signal in SIGNALS if base in NAMES[signal] and _may_be(signal, base, unit))
    return next(named_so, None) or next((signal for signal in SIGNALS if base in _UNIT_NAMES[signal]), None)


def _may_be(signal: Signal, base: str, unit: str | None) -> bool:
    """Whether a name with two meanings has the unit of this signal."""
    warm = unit is not None and unit.casefold() in _FACTORS["temperature"]
    return base not in _TWO_MEANINGS or warm == (signal == "temperature")


def unit_of(table: AnyTable, place: int) -> str | None:
    """The unit of a column as written: in its name, else in the row of units beneath the header."""
    beneath = table.units[place] if table.units is not None and place < len(table.units) else ""
    return split_name(table.header[place])[1] or unicodedata.normalize("NFKC", beneath).strip(" []()") or None


def ambient_in(table: AnyTable) -> tuple[Column | None, str]:
    """The column with the temperature around the cell; none, and a note, where its unit is no unit of temperature."""
    place = named(table.header, AMBIENT)
    if place is None:
        return None, ""
    name, unit = table.header[place], unit_of(table, place)
    folded = None if unit is None else unit.casefold()
    if folded is None or _folded(folded) in AMBIENT:  # Digatron: the name stands where the unit is looked for
        return Column("temperature", place, name, None), ""
    if folded not in _FACTORS["temperature"]:
        return None, (
            f'column "{shown(name)}" has the unit "{shown(unit)}", which is no unit of temperature that is known '
            f"({_OFFERED['temperature']}); it is not used (--temperature says the ambient temperature in degC)."
        )
    return Column("temperature", place, name, folded), ""


def may_be_temperatures(header: Sequence[str], taken: Container[int]) -> list[int]:
    """Places of columns that may hold a temperature of the cell and have no name that says so."""
    bases = [split_name(name)[0] for name in header]
    return [k for k, base in enumerate(bases) if k not in taken and _LIKE_A_TEMPERATURE.match(base)]


def half_cell(header: Sequence[str]) -> bool:
    """Whether columns hold the potentials of both electrodes, and none the voltage between them."""
    bases = {split_name(name)[0] for name in header}
    return {_WORKING, _COUNTER} <= bases and _preferred(NAMES["voltage"], bases) == _WORKING


def _preferred(names: Sequence[str], bases: Container[str]) -> str | None:
    return next((name for name in names if name in bases), None)


def named(header: Sequence[str], names: Sequence[str]) -> int | None:
    """Place of the column with the first of these folded names; None where it is absent or there are two."""
    bases = [split_name(name)[0] for name in header]
    found = _preferred(names, bases)
    return bases.index(found) if found is not None and bases.count(found) == 1 else None


def resolve(table: AnyTable, options: ReadOptions) -> dict[Signal, Column]:
    """Find the column of each signal; what the user said in the options goes before what the names suggest.

    Raises `BsaError` if a signal has no column, two columns, or a unit that is not known.
    """
    known = ((signal, _index(table, signal, options)) for signal in SIGNALS)
    places = {signal: index for signal, index in known if index is not None}
    required: list[Signal] = ["time", "voltage"]
    if options.constant_current_a is None:
        required.append("current")
    missing = [signal for signal in required if signal not in places]
    if missing:
        raise _lacking(table, missing)
    taken: dict[int, Signal] = {}
    for signal, index in places.items():
        other = taken.setdefault(index, signal)
        if other != signal:
            raise BsaError(
                f'{table.source}: column "{shown(table.header[index])}" is named for both {other} and {signal}.',
                f"give one of them another column: --column {signal}=NAME.",
            )
    found = {}
    for signal, index in places.items():
        unit, written = _unit(table, index, signal, options), unit_of(table, index)
        replaced = written is not None and signal in options.units and not _is_same(signal, written, unit)
        found[signal] = Column(signal, index, table.header[index], unit, written if replaced else None)
    return found


def _lacking(table: AnyTable, missing: Sequence[Signal]) -> BsaError:
    """The error of a table without columns for these signals."""
    lacks = f"no column for {', '.join(missing)}"
    if "voltage" in missing and _is_of_cycles(table.header):
        return BsaError(
            f"{table.source} is a table with one row for each cycle: it has {lacks}.",
            "give the cycler's record of time, voltage and current: how a cell ages is read from the whole curves of "
            "its cycles, and not from their capacities alone.",
        )
    return BsaError(f"{table.source} has {lacks}.", _which(table.header, missing))


def _is_of_cycles(header: Sequence[str]) -> bool:
    """Whether the columns are those of a table of capacities by cycle."""
    return named(header, EXTRA["cycle"]) is not None and any(
        split_name(name)[0].startswith(_CAPACITIES) for name in header
    )


def _which(header: Sequence[str], missing: Sequence[Signal]) -> str:
    options = " ".join(f"--column {signal}=NAME" for signal in missing)
    also = " (or, for the last, the current of the whole file: --constant-current A, negative on discharge)"
    nameless = list(header) == [str(number) for number in range(1, len(header) + 1)]
    called = "have no names and are numbered:" if nameless else "are"
    return f"its columns {called} {listed(header)}; say which with {options}{also * ('current' in missing)}."


def _index(table: AnyTable, signal: Signal, options: ReadOptions) -> int | None:
    header, wanted = table.header, options.columns.get(signal)
    if wanted is not None:
        places = [k for k, name in enumerate(header) if name == wanted]
        if not places:
            raise no_column(wanted, header, table.source)
    else:
        if signal == "voltage" and half_cell(header):
            raise _no_voltage(table)
        bases = [split_name(name)[0] for name in header]
        # ``|I|/A`` is an amplitude of an impedance: the current stands beside it.
        meant = [
            _may_be(signal, base, unit_of(table, k)) and not header[k].lstrip().startswith("|")
            for k, base in enumerate(bases)
        ]
        preferred = _preferred(NAMES[signal], [base for base, fits in zip(bases, meant, strict=True) if fits])
        if preferred is None and signal == "time":
            preferred = _preferred(EXTRA["date"], bases)
        places = [k for k, base in enumerate(bases) if base == preferred and meant[k]]
        places = places or [k for k, base in enumerate(bases) if base in _UNIT_NAMES[signal]]
    if len(places) > 1:
        raise BsaError(
            f"{table.source} has {len(places)} columns for {signal}: {listed(header[k] for k in places)}.",
            f"rename them in the file, or say which with --column {signal}=NAME.",
        )
    return places[0] if places else None


def _no_voltage(table: AnyTable) -> BsaError:
    names = {split_name(name)[0]: shown(name) for name in reversed(table.header)}
    working, counter = names[_WORKING], names[_COUNTER]
    return BsaError(
        f'{table.source} has the potentials of both electrodes ("{working}", "{counter}"), but not the voltage between '
        "them.",
        f'export Ewe-Ece too; or, if "{working}" is the voltage of the cell, say --column voltage={working}.',
    )


def _unit(table: AnyTable, index: int, signal: Signal, options: ReadOptions) -> str | None:
    unit = options.units.get(signal) or unit_of(table, index)
    if unit is None or (signal == "time" and ":" in unit):  # "hh:mm:ss" tells how a clock is written
        return None
    folded = unit.strip().rstrip(".").casefold()
    if folded not in _FACTORS[signal]:
        raise BsaError(
            f'{table.source}: column "{shown(table.header[index])}" has the unit "{shown(unit)}", which is no unit of '
            f"{signal}.",
            f"say --unit {signal}=UNIT with {_OFFERED[signal]}.",
        )
    return folded


def _is_same(signal: Signal, one: str, other: str | None) -> bool:
    """Whether two ways to write a unit mean the same one."""
    folded = [unit.strip().casefold() for unit in (one, other or "")]
    factors = [_FACTORS[signal].get(unit) for unit in folded]
    return factors[0] == factors[1] and (signal != "temperature" or (folded[0] in _KELVIN) == (folded[1] in _KELVIN))
