"""What records tell of the cell that is to match them: potentials, size, temperature, voltage window."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.reading.open_circuit import open_circuit_curve, slow_curve
from ...core.record import Record
from ...core.segmentation.recognised_protocol import with_switches
from ...core.target import THERMODYNAMIC_FACTOR, Value, factor_name, target_named
from ...core.task import NEAREST, CellModel, ParameterFile, ParameterSource
from ...core.trajectory import FloatArray, Trajectory
from .record_request import RecordRequest

if TYPE_CHECKING:
    from ...plugins.pybamm.before_search.nearest_potentials import Potentials

WIDTH = "Electrode width [m]"

_MARGIN_V = 0.2
"""Volts by which a model's voltage window is wider than a record whose steps are simulated: they end by themselves."""

THERMAL, ISOTHERMAL = "thermal", "isothermal"
"""PyBaMM's option for a cell's temperature, and its value for a constant one."""

_MOST_OF_THE_WINDOW = 0.6
"""Share of the voltage window that a cycle crosses at least if its charge is to tell the cell's size."""

NEAR_POTENTIALS_V = 0.015
"""Misfit of the slowest record up to which a set's potentials are near, V: published ones of one chemistry differ by 12
to 16 mV."""

_WARMS_K = 2.0
"""Change of the temperature from which on the model is thermal, and transport depends on it, K: a smaller one may be
that of the room."""

_WARMS_AT = 0.9
"""Current, as a share of the charge that the cell holds over an hour, from which on a cell whose temperature was not
measured is simulated with one: at 1C cylindrical and pouch cells warm by 3 to 15 K (LG M50, NASA B0005, Panasonic
18650PF). Held out at 2C, an isothermal fit of two cells is off by twice as much."""

_COOLED = ("Cell volume [m3]", "Cell cooling surface area [m2]", "Total heat transfer coefficient [W.m-2.K-1]")
"""What a lumped thermal model needs of a parameter set."""

_REST_SHARE = 0.01
"""Share of a record's largest current below which the cell rests."""

TELLS_K = 10.0
"""Distance of the temperatures around fitted records from which on they tell activation energies, K: over less a usual
one (20 kJ/mol) changes a rate by less than a third, and priors know rates to a factor of two."""

VOLUME, SURFACE, _COOLING = _COOLED

_SHEET, _CELL = 40.0, 7.0
"""Surface of a body over its volume to the power of two thirds: 5 for a sphere, 6 for a cylindrical cell, 10 to 40 for
pouch cells, and more than 100 in sets whose surface is that of a single electrode sheet. A cell of many sheets is taken
for a compact body."""

_MEASURED_FACTOR = 2.2
"""Thermodynamic factor of LiPF6 in carbonates at 1 mol/l and 25 degC: 2.17 in PC:EC:DMC (Valoen and Reimers, J.
Electrochem. Soc. 152 (2005) A882, doi:10.1149/1.1872737), 2.18 in EC:EMC (Landesfeind and Gasteiger, J. Electrochem.
Soc. 166 (2019) A3079, doi:10.1149/2.0571912jes)."""


def warms_by(records: Sequence[Record]) -> float:
    """Largest change of the measured temperature in a record, K; 0 where none was measured."""
    measured = [t for record in records if (t := record.trajectory.temperature) is not None]
    return max((float(np.ptp(temperature)) for temperature in measured), default=0.0)


def with_thermal_model(
    options: dict[str, Any],
    requests: Sequence[RecordRequest],
    records: Sequence[Record],
    held_out: Sequence[Record],
    parameter_set: ParameterSource,
    values: Any,
) -> tuple[dict[str, Any], list[str]]:
    """The model's options with a temperature where the cell warms, and what is to be said of it.

    That is where a temperature was measured that changes, and where none was and the current is fast, that of records
    that are held out included; ``values`` are those of the cell's parameter set. Where no temperature was measured and
    the set does not say how its cell is cooled, or that nothing cools it, the cell stays isothermal.
    """
    from ...plugins.pybamm.cells.parameter_sets import states

    if THERMAL in options or any(request.protocol is not None for request in requests):
        return options, []
    change_k = warms_by(records)
    if change_k >= _WARMS_K:
        why = (
            f"The measured temperature changes by {change_k:.1f} K: the model is thermal (lumped); its temperature is "
            "fitted beside the voltage"
        )
    elif _measured(records) or not all(values.get(name) for name in _COOLED):
        return options, []
    elif (rate := fastest_rate([*records, *held_out], values)) >= _WARMS_AT:
        fast = f"The current reaches {rate:.2g} times the cell's charge per hour and no temperature was measured: "
        if not states(parameter_set, _COOLING):
            return options, [
                f"{fast}cells warm at such currents, but {parameter_set} does not say how its cell is cooled. The "
                "model stays isothermal (--options thermal=lumped simulates the temperature)."
            ]
        why = f"{fast}the model is thermal (lumped); its cooling starts from that of the parameter set"
    else:
        return options, []
    return {**options, THERMAL: "lumped"}, [f"{why} (--options thermal=isothermal keeps it constant)."]


def cooling_note(
    parameter_set: ParameterSource, options: Mapping[str, Any], given: Collection[str], values: Any
) -> list[str]:
    """What is to be said of a cell that warms, and of whose cooling neither its set nor the person says anything."""
    from ...plugins.pybamm.cells.parameter_sets import FILL_FROM, states

    if not is_thermal(options) or _COOLING in given or states(parameter_set, _COOLING):
        return []
    return [
        f"{parameter_set} does not say how its cell is cooled: a heat transfer coefficient of "
        f"{float(values[_COOLING]):g} W.m-2.K-1 is taken, that of {FILL_FROM[-1]}."
    ]


def _measured(records: Sequence[Record]) -> bool:
    return any(record.trajectory.temperature is not None for record in records)


def fastest_rate(records: Sequence[Record], values: Any) -> float:
    """Largest root mean square of the current under load, in charges of the cell per hour; 0 if no record tells."""
    cycles = whole_cycles(records, values)
    charge_ah = max((span_ah(cycle) for cycle in cycles), default=0.0)
    rates = [_rms_under_load(cycle.time, cycle.current) / charge_ah for cycle in cycles if charge_ah > 0.0]
    return max(rates, default=0.0)


def _rms_under_load(time: FloatArray, current: FloatArray) -> float:
    middle = 0.5 * (current[1:] + current[:-1])
    loaded = np.diff(time) * (np.abs(middle) > _REST_SHARE * np.max(np.abs(current)))
    return float(np.sqrt(np.sum(loaded * middle**2) / max(np.sum(loaded), 1e-12)))


def is_thermal(options: Mapping[str, Any]) -> bool:
    """Whether a model with these options has a temperature of its own."""
    return bool(options.get(THERMAL, ISOTHERMAL) != ISOTHERMAL)


def at_several_temperatures(options: Mapping[str, Any], records: Sequence[Record]) -> bool:
    """Whether the cell is simulated at temperatures that differ: it warms, or its surroundings do."""
    return is_thermal(options) or apart_k(records) >= _WARMS_K


def apart_k(records: Sequence[Record]) -> float:
    """How far the temperatures around records are apart, as far as these are known, K."""
    return float(np.ptp([record.ambient_k for record in records if record.ambient_k is not None] or [0.0]))


def temperature_dependent(cell: CellModel, search: str | Mapping[str, Any]) -> tuple[ParameterSource, list[str]]:
    """The cell's parameter set with transport that depends on the temperature, and what is to be said of it.

    What the cell's model does not have is given it too, for another model that begins there, but is not spoken of.
    """
    from ...plugins.pybamm.before_search.activation_energies import (
        TRANSPORT,
        independent_of_temperature,
        with_activation_energies,
    )
    from ...plugins.pybamm.before_search.influence import without_influence
    from ...plugins.pybamm.before_search.presets import is_preset

    parameter_set = cell.parameter_set
    constant = tuple(name for name in independent_of_temperature(parameter_set) if name not in cell.overrides)
    idle = without_influence(cell, {name: target_named(factor_name(name)) for name in constant})
    shown = [name for name in constant if name not in idle]
    if not shown:
        return parameter_set, []
    names = ", ".join(name.split(" [")[0].lower() for name in shown)
    said = f"In {parameter_set} these do not depend on the temperature: {names}."
    if not is_preset(search):  # it may name them as the numbers that they are
        return parameter_set, [
            f"{said} A warm cell is simulated with those of a cold one, and a fast discharge that heats the cell may "
            "be predicted to end too early."
        ]
    energies = ", ".join(f"{TRANSPORT[name].energy / 1e3:g}" for name in shown)
    return with_activation_energies(parameter_set, constant), [
        f"{said} They get activation energies ({energies} kJ/mol, those of other published sets), at the reference "
        "temperature they stay as they are."
    ]


def with_searched_energies(
    parameter_set: ParameterSource,
    search: str | Mapping[str, Any],
    fixed: Mapping[str, float],
    fitted: Sequence[Record],
) -> tuple[ParameterSource, list[str]]:
    """The parameter set with activation energies that a preset searches, and what is to be said of them.

    Rates that are ``fixed`` to a number have none. Where the temperatures around the ``fitted`` records are too near to
    tell, the set stays.
    """
    from ...plugins.pybamm.before_search.activation_energies import (
        RATES,
        additional_energy_name,
        with_additional_energies,
    )
    from ...plugins.pybamm.before_search.presets import searches

    spread_k = apart_k(fitted)
    if spread_k < TELLS_K or not searches(search, additional_energy_name(RATES[0])):
        return parameter_set, []
    return with_additional_energies(parameter_set, [name for name in RATES if name not in fixed]), [
        f"The temperatures around the fitted records are {spread_k:.0f} K apart: how transport and reactions depend "
        "on the temperature is fitted too, as additional activation energies."
    ]


def measured_thermodynamic_factor(
    model: CellModel, values: Any, search: str | Mapping[str, Any], given: Collection[str]
) -> tuple[dict[str, float], list[str]]:
    """Where the search for the electrolyte's thermodynamic factor starts if the set has none, and what is said of it.

    ``values`` are those of the model's set.

    A set without a measured one has 1, that of an ideal solution, and with it half of the voltage that salt gradients
    take.
    """
    from ...plugins.pybamm.before_search.influence import without_influence
    from ...plugins.pybamm.before_search.presets import searches

    own = values.get(THERMODYNAMIC_FACTOR)
    if own != 1.0 or THERMODYNAMIC_FACTOR in given or not searches(search, THERMODYNAMIC_FACTOR):
        return {}, []
    if without_influence(model, {THERMODYNAMIC_FACTOR: Value(THERMODYNAMIC_FACTOR)}):
        return {}, []
    return {THERMODYNAMIC_FACTOR: _MEASURED_FACTOR}, [
        f"The electrolyte's thermodynamic factor is 1 in the set, that of an ideal solution: the search starts from "
        f"{_MEASURED_FACTOR:g}, that of measured electrolytes at 1 mol/l."
    ]


def with_chosen_potentials(
    parameter_set: ParameterSource, wanted: str, records: Sequence[Record], corrected: bool
) -> tuple[ParameterSource, list[str]]:
    """The parameter set with the potentials that were asked for, and what is to be said of them.

    Where they may be ``corrected``, a slow record shows what the set's own, or those that were asked for, lack.
    """
    from ...plugins.pybamm.before_search.measured_potentials import FAR_V
    from ...plugins.pybamm.before_search.nearest_potentials import chosen_potentials, own_potentials, with_potentials

    curve = open_circuit_curve([record.trajectory for record in records])
    own = None if curve is None or parameter_set == NEAREST else own_potentials(parameter_set, curve)
    own_left = ""
    if curve is not None and own is not None:
        own_left = f"The open-circuit potentials of {parameter_set} leave {1e3 * own.rms_v:.1f} mV of {curve.words}"
    if parameter_set != NEAREST and not wanted:
        if curve is None or own is None:
            return parameter_set, []
        return _with_own_potentials(parameter_set, own.corrected_by(curve) if corrected else own, own_left)
    named = "name a set with --parameters (bsa list parameters shows all)"
    without = [named] * (parameter_set == NEAREST) + ["leave --ocp out"] * bool(wanted)
    found = chosen_potentials(wanted or NEAREST, curve, " and ".join(without))
    assert curve is not None  # else no potentials can be chosen
    taken = found[0]
    base = taken.sets["Positive"] if parameter_set == NEAREST else parameter_set
    left = f"{1e3 * taken.rms_v:.1f} mV"
    compared = (
        f"{own_left}, those of {taken} {left}"
        if own_left
        else f"The potentials of {taken} leave {left} of {curve.words}"
    )
    said = f"{compared}: they are taken, with electrodes balanced for them, and all else from {base}."
    if taken.rms_v > FAR_V:
        said += (
            " No pair comes near: measured cells left 4 to 20 mV. Check the sign and the unit of the current. A cell "
            "of another chemistry (sodium, lithium titanate) needs a parameter file of its own (--parameters FILE)."
        )
    others = "; ".join(f"{other}: {1e3 * other.rms_v:.1f} mV" for other in found[1:4])
    if others:
        less_left = any(other.rms_v < taken.rms_v for other in found[1:4])
        said += f" The next likeliest: {others}." + " What leaves less needs a less usual polarisation." * less_left
    if corrected:
        taken = taken.corrected_by(curve)
    if taken.corrections is not None:
        said += f" {_corrected_words(taken)}"
    chosen, notes = with_potentials(base, taken), [said]
    if parameter_set != NEAREST:
        return chosen, notes
    # The set was chosen for its potentials: the cell's rates are those of any other set as likely.
    chosen, said_of_rates = _with_usual_rates(chosen, taken.sets["Positive"])
    return chosen, [*notes, *said_of_rates]


def _with_own_potentials(
    parameter_set: ParameterSource, own: Potentials, left: str
) -> tuple[ParameterSource, list[str]]:
    """A set with its own potentials, corrected or as they are, and what is to be said of them.

    ``left`` says what they leave of the curve uncorrected.
    """
    from ...plugins.pybamm.before_search.nearest_potentials import with_potentials

    said, far = f"{left}.", own.uncorrected.rms_v > NEAR_POTENTIALS_V
    if far:
        said = (
            f"{left}: --ocp nearest takes the nearest of the installed sets, --parameters nearest the rest of that set "
            "too."
        )
    if own.corrections is not None:
        return with_potentials(parameter_set, own), [f"{said} {_corrected_words(own)}"]
    return parameter_set, [said] * far


def _corrected_words(potentials: Potentials) -> str:
    return (
        "The potentials are corrected by that record, with electrodes balanced for them; but for its ends they leave "
        f"{1e3 * potentials.rms_v:.1f} mV."
    )


def _with_usual_rates(parameter_set: ParameterFile, base: str) -> tuple[ParameterFile, list[str]]:
    """The parameter set without rates that lie far from all other published ones, and what is to be said of it."""
    from ...plugins.pybamm.before_search.usual_rates import unusual_rates, with_usual_rates

    unusual = unusual_rates(parameter_set)
    if not unusual:
        return parameter_set, []
    factors = ", ".join(f"{name.split(' [')[0].lower()} times {factor:.2g}" for name, factor in unusual.items())
    return with_usual_rates(parameter_set, unusual), [
        f"Rates of {base} that lie far from those of all other installed sets are replaced by the nearest of those: "
        f"{factors}."
    ]


def hysteresis_note(records: Sequence[Record]) -> list[str]:
    """What is to be said of charge and discharge that are far apart where they are slow."""
    from ...plugins.pybamm.before_search.balance import usual_polarisation

    slow = slow_curve(record.trajectory for record in records)
    if slow is None:
        return []
    usual_v, deviation_v = usual_polarisation(slow)
    # Each is off by the polarisation; two deviations more are unlikely.
    if not slow.gap_v > 2.0 * (usual_v + 2.0 * deviation_v):
        return []
    return [
        f"Slow charge and discharge are {1e3 * slow.gap_v:.0f} mV apart at the same charge, more than polarisation "
        "explains: --effect ocp-hysteresis adds a hysteresis of the open-circuit voltage to the model."
    ]


def volume_and_surface(values: Any, factor: float) -> tuple[dict[str, float], list[str]]:
    """Volume and surface of a cell with so many times the electrode area, and what is to be said of them.

    Its shape stays, unless it is that of one electrode sheet.
    """
    if VOLUME not in values or SURFACE not in values:
        return {}, []
    volume, surface = float(values[VOLUME]) * factor, float(values[SURFACE]) * factor ** (2.0 / 3.0)
    face = volume ** (2.0 / 3.0)
    compact = _CELL * face
    if surface < _SHEET * face:
        return {VOLUME: volume, SURFACE: surface}, []
    return {VOLUME: volume, SURFACE: compact}, [
        f'The set\'s "{SURFACE}" is that of a single electrode sheet ({surface:.2g} m2 at this size): that of a '
        f"compact cell of its volume is taken, {compact:.2g} m2."
    ]


def wide_window(values: Any, records: Sequence[Record]) -> dict[str, float]:
    """Voltage cut-offs beyond all of the records; what the set calls empty and full stays."""
    voltages = np.concatenate([record.trajectory.voltage for record in records])
    wide: dict[str, float] = {}
    for side, percent, wider in (
        ("Lower", 0, min(float(values["Lower voltage cut-off [V]"]), float(voltages.min()) - _MARGIN_V)),
        ("Upper", 100, max(float(values["Upper voltage cut-off [V]"]), float(voltages.max()) + _MARGIN_V)),
    ):
        cut_off, open_circuit = f"{side} voltage cut-off [V]", f"Open-circuit voltage at {percent}% SOC [V]"
        wide |= {open_circuit: float(values.get(open_circuit, values[cut_off])), cut_off: wider}
    return wide


def whole_cycles(records: Sequence[Record], values: Any) -> list[Trajectory]:
    """The cycles that cross most of the voltage window: one that stays in part of it says little about the capacity."""
    # Over many cycles the counted charge drifts; within one it does not matter.
    each = (cycle for record in records for cycle in map(record.trajectory.cycle, record.trajectory.cycles))
    return [cycle for cycle in each if is_whole(cycle, values)]


def is_whole(cycle: Trajectory, values: Any) -> bool:
    """Whether a cycle crosses most of the voltage window of a cell's values."""
    window = float(values["Upper voltage cut-off [V]"]) - float(values["Lower voltage cut-off [V]"])
    return bool(np.ptp(cycle.voltage) > _MOST_OF_THE_WINDOW * window)


def span_ah(cycle: Trajectory) -> float:
    """The charge between a cycle's fullest and its emptiest moment, A.h."""
    return float(np.ptp(with_switches(cycle).discharge_capacity))
