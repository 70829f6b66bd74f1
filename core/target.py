"""What a searched parameter acts on, as a type; a name is read in one place, where a person's notation comes in."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

INITIAL_SOC = "Initial state of charge"
"""Name of the initial state of charge, of all records together; `soc_name` gives that of one record."""

INITIAL_VOLTAGE = "Initial voltage correction"
"""Name of the correction of the open-circuit voltage at which records start, without its unit and its place."""

CYCLABLE_LITHIUM = "Cyclable lithium factor"
"""Name of the multiplier on the lithium that both electrodes share."""

THERMODYNAMIC_FACTOR = "Thermodynamic factor"
"""PyBaMM's name of a property of the electrolyte; that it ends like a multiplier makes it none."""

_FACTOR = " factor"

_CURRENT_OFFSET = re.compile(r"Current offset: (.+) \[A\]")
_DIFFUSIVITY_SHAPE = re.compile(r"(Negative|Positive) particle diffusivity factor at stoichiometry (\d*\.?\d+)")
_INITIAL_VOLTAGE = re.compile(rf"{INITIAL_VOLTAGE}(?: at (\d+\.?\d*) V)? \[V\]")
_OCP_SHAPE = re.compile(r"(Negative|Positive) electrode OCP correction at stoichiometry (\d*\.?\d+) \[V\]")


ALIKE_V = 0.05
"""Difference of two rest voltages, V, over which a correction of one has largely lost its meaning for the other: a
twentieth of the charge near the full end of usual cells, where the bumps of the open-circuit potentials are as wide."""


@dataclass(frozen=True)
class Value:
    """Replaces a number of the parameter set."""

    name: str  # PyBaMM's name of it.


@dataclass(frozen=True)
class Factor:
    """Multiplies what the parameter set has, a number or a function."""

    name: str  # PyBaMM's name of what is multiplied.


@dataclass(frozen=True)
class InitialSoc:
    """The state of charge at which a record starts, 0 to 1."""

    record: str = ""  # Name of the record; empty for all records.


@dataclass(frozen=True)
class InitialVoltage:
    """Adds to the rest voltage at which records start, V: the simulated cell's open-circuit voltage is their sum.

    What a model's open-circuit curve is off by at one voltage is the same for all records that start there.
    """

    near: float | None = None  # The rest voltage near which it applies, V (`CellChange.started_at`); None for any.


@dataclass(frozen=True)
class CurrentOffset:
    """Adds to the measured current of a record wherever one passes, A, positive on discharge."""

    record: str  # Name of the record.


@dataclass(frozen=True)
class CyclableLithium:
    """Multiplies the lithium that both electrodes share."""


@dataclass(frozen=True)
class OcpShape:
    """Adds a smooth bump to the open-circuit potential of an electrode."""

    electrode: str  # ``"Negative"`` or ``"Positive"``.
    stoichiometry: float  # Where the bump has its height, between 0 and 1.

    @property
    def ocp(self) -> str:
        """PyBaMM's name of the potential."""
        return ocp_name(self.electrode)


@dataclass(frozen=True)
class DiffusivityShape:
    """Multiplies the diffusivity in the particles of an electrode near one stoichiometry."""

    electrode: str  # ``"Negative"`` or ``"Positive"``.
    stoichiometry: float  # Where the whole factor applies, between 0 and 1.

    @property
    def diffusivity(self) -> str:
        """PyBaMM's name of the diffusivity."""
        return f"{self.electrode} particle diffusivity [m2.s-1]"


@dataclass(frozen=True)
class EffectValue:
    """A parameter that exists only when an effect does."""

    # effect, parameter: Name of the effect, and the parameter's short name in it.
    effect: str
    parameter: str


Target = (
    Value
    | Factor
    | InitialSoc
    | InitialVoltage
    | CurrentOffset
    | CyclableLithium
    | OcpShape
    | DiffusivityShape
    | EffectValue
)


def soc_name(record: str) -> str:
    """Name of the initial state of charge of one record."""
    return f"{INITIAL_SOC}: {record}"


def current_offset_name(record: str) -> str:
    """Name of the offset of the current of one record."""
    return f"Current offset: {record} [A]"


def initial_voltage_name(near: float | None = None) -> str:
    """Name of the correction of the voltage at which records start, near a rest voltage in V."""
    return f"{INITIAL_VOLTAGE} [V]" if near is None else f"{INITIAL_VOLTAGE} at {near:.2f} V [V]"


def factor_name(name: str) -> str:
    """Name of the multiplier on a parameter of the set."""
    return name + _FACTOR


def ocp_name(electrode: str) -> str:
    """PyBaMM's name of the open-circuit potential of an electrode."""
    return f"{electrode} electrode OCP [V]"


def target_named(name: str, known: Iterable[str] = ()) -> Target:
    """The target that a person's notation means.

    ``"NAME"`` is a value, ``"NAME factor"`` a multiplier. Others are ``"Initial state of charge"`` (of one record:
    ``"Initial state of charge: RECORD"``), ``"Initial voltage correction at 4.18 V [V]"`` (of all records without
    ``at 4.18 V``), ``"Current offset: RECORD [A]"``, ``"Cyclable lithium factor"``, ``"Positive electrode OCP
    correction at stoichiometry 0.3 [V]"`` and ``"Positive particle diffusivity factor at stoichiometry 0.9"``.
    ``known`` are names of the parameter set: one of these is a value, whatever it ends with.
    """
    if name == INITIAL_SOC:
        return InitialSoc()
    if name.startswith(soc_name("")):
        return InitialSoc(name.removeprefix(soc_name("")))
    offset = _CURRENT_OFFSET.fullmatch(name)
    if offset is not None:
        return CurrentOffset(offset[1])
    start = _INITIAL_VOLTAGE.fullmatch(name)
    if start is not None:
        return InitialVoltage(None if start[1] is None else float(start[1]))
    if name == CYCLABLE_LITHIUM:
        return CyclableLithium()
    shape = _OCP_SHAPE.fullmatch(name)
    if shape is not None and 0.0 < float(shape[2]) < 1.0:
        return OcpShape(shape[1], float(shape[2]))
    shape = _DIFFUSIVITY_SHAPE.fullmatch(name)
    if shape is not None and 0.0 < float(shape[2]) < 1.0:
        return DiffusivityShape(shape[1], float(shape[2]))
    if name.endswith(_FACTOR) and name not in (THERMODYNAMIC_FACTOR, *known):
        return Factor(name.removesuffix(_FACTOR))
    return Value(name)


@dataclass(frozen=True)
class CellChange:
    """What a candidate changes about a cell, sorted by target."""

    # Numbers that replace those of the parameter set, by PyBaMM's names.
    values: dict[str, float] = field(default_factory=dict)
    # What values and functions of the set are multiplied by, by PyBaMM's names.
    factors: dict[str, float] = field(default_factory=dict)
    cyclable_lithium: float = 1.0  # Multiplies the lithium that both electrodes share.
    # State of charge at which a record starts, by the record's name; under the empty name that of all others.
    initial_soc: dict[str, float] = field(default_factory=dict)
    # What is added to the measured current of a record, A, by its name.
    current_offset: dict[str, float] = field(default_factory=dict)
    # Heights of the bumps that are added to open-circuit potentials, V.
    ocp_shape: dict[OcpShape, float] = field(default_factory=dict)
    # What diffusivities are multiplied by near a stoichiometry.
    diffusivity_shape: dict[DiffusivityShape, float] = field(default_factory=dict)
    effects: dict[str, float] = field(default_factory=dict)  # Parameters of effects, by their full names.
    # What is added to the rest voltage at which records start, V, by the rest voltage near which it applies.
    initial_voltage: dict[float | None, float] = field(default_factory=dict)

    def soc_of(self, record: str) -> float | None:
        """The state of charge at which a record starts; None where nothing is said of it."""
        return self.initial_soc.get(record, self.initial_soc.get(""))

    def started_at(self, rest_v: float) -> float:
        """The open-circuit voltage at which the cell starts for a record that starts at a rest voltage, V.

        The nearest correction counts, the less the farther off it is (a Gaussian of `ALIKE_V`).
        """
        places = [near for near in self.initial_voltage if near is not None]
        if not places:
            return rest_v + self.initial_voltage.get(None, 0.0)
        near = min(places, key=lambda place: abs(place - rest_v))
        return rest_v + self.initial_voltage[near] * math.exp(-0.5 * ((rest_v - near) / ALIKE_V) ** 2)


def change_of(targets: Mapping[str, Target], candidate: Mapping[str, float]) -> CellChange:
    """Sort a candidate's values by what they act on.

    ``targets`` are by the parameters' names; values of the candidate under other names are left out.
    """
    change = CellChange()
    for name, target in targets.items():
        if name not in candidate:
            continue
        value = float(candidate[name])
        match target:
            case Value(base):
                change.values[base] = value
            case Factor(base):
                change.factors[base] = value
            case InitialSoc(record):
                change.initial_soc[record] = value
            case InitialVoltage(near):
                change.initial_voltage[near] = value
            case CurrentOffset(record):
                change.current_offset[record] = value
            case CyclableLithium():
                change = replace(change, cyclable_lithium=value)
            case OcpShape():
                change.ocp_shape[target] = value
            case DiffusivityShape():
                change.diffusivity_shape[target] = value
            case EffectValue():
                change.effects[name] = value
    return change
