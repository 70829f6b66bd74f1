"""From measured records to a task: what to search, at which size, from which state of charge."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...core.ageing.long_record import long_record
from ...core.cell import CELL, SPECTRUM, TEMPERATURE
from ...core.errors import BsaError
from ...core.parameters import ParameterSpace
from ...core.prediction import begins_under_load
from ...core.reading.parts import parts_between_gaps
from ...core.recognised_protocol import recognised_protocol, with_switches
from ...core.record import ReadOptions, Record
from ...core.registry import installed
from ...core.spectrum import ImpedanceSpectrum
from ...core.target import INITIAL_SOC, InitialSoc, soc_name
from ...core.task import NEAREST, CellModel, Experiment, ParameterFile, ParameterSource, Protocol, Task
from ...core.trajectory import StepKind, Trajectory
from .lives import as_life, with_ageing
from .spectra import ohmic_resistances, spectrum_experiment, spectrum_notes

WIDTH = "Electrode width [m]"

RECOGNISED: Literal["recognised"] = "recognised"
"""In place of a protocol: that which the record's own steps show."""

_MARGIN_V = 0.2
"""Volts by which a model's voltage window is wider than a record whose steps are simulated: they end by themselves."""

CONTACT, RESISTANCE = "contact resistance", "Contact resistance [Ohm]"
"""PyBaMM's option for a series resistance, and its parameter."""

THERMAL, ISOTHERMAL = "thermal", "isothermal"
"""PyBaMM's option for a cell's temperature, and its value for a constant one."""

_CONTACT_SHARE = 0.6
"""Share of the voltage jump at a current step that is put down to the contacts, to start with."""

_MOST_OF_THE_WINDOW = 0.6
"""Share of the voltage window that a cycle crosses at least if its charge is to tell the cell's size."""

_PROMPT_S, _NEARLY_EMPTY = 10.0, 0.1
"""Latest sample after a current step that shows its resistance, s, and the share of the voltage range at whose bottom
none does: a minute late, or at the end of a discharge, the same cells show two to ten times as much."""

_HYSTERESIS_V = 0.03
"""Distance of a slow charge from a slow discharge that polarisation does not explain, V: at C/20 it takes 5 to 8 mV off
each, of which this is twice."""

_NEAR_POTENTIALS_V = 0.015
"""Misfit of a slow record up to which a set's potentials are near, V: published ones of one chemistry differ by 12 to
16 mV."""

_WARMS_K = 2.0
"""Change of a cell's temperature from which on its model is thermal, K: a smaller one may be that of the room."""

_GROWS_WITH_AREA = {"Cell volume [m3]": 1.0, "Cell cooling surface area [m2]": 2.0 / 3.0}
"""Powers of the electrode area with which a cell's other sizes grow, where its shape stays."""

_MANY_CYCLES = 50
"""Cycles from which on a record is more likely meant as a life: each simulation of so many takes minutes."""

_SAME_SIZE = (0.8, 1.25)
"""Ratios of measured to nominal capacity that the search bridges by itself."""


@dataclass(frozen=True)
class RecordRequest:
    """A record to be matched."""

    source: Path | Record | ImpedanceSpectrum  # The file, or what was read from it.
    read: ReadOptions = field(default_factory=ReadOptions)  # What its header does not say.
    reader: str | None = None  # The reader to use; None finds the one that fits.
    reader_options: Mapping[str, Any] = field(default_factory=dict)  # The reader's own options.
    # As in `Experiment`; ``"recognised"`` for that which the record's own steps show.
    protocol: Protocol | Literal["recognised"] | None = None
    # scored_cycle, temperature_k, initial_soc: As in `Experiment`.
    scored_cycle: int | None = None
    temperature_k: float | None = None
    initial_soc: float | None = None
    # Makes a long record of it: these cycles are compared by their curves, all others by the cycle table.
    detailed_cycles: Sequence[int] | Literal["auto"] | None = None
    # Of a life, whose protocol is recognised: so many cycles are fitted, the later ones held out; None fits all.
    fit_cycles: int | None = None
    shown_protocol: Protocol = ()  # What a recognised protocol came to, where that is known already.
    initial_voltage: float | None = None  # Open-circuit voltage at the start of the life that it is a part of, V.

    @property
    def as_measured(self) -> bool:
        """Whether the record says all of how it was made: currents in A, not rates, and where it starts."""
        return self.protocol in (None, RECOGNISED)

    def protocol_of(self, record: Record) -> Protocol | None:
        """The protocol of its experiment."""
        if self.protocol == RECOGNISED:
            return self.shown_protocol or recognised_protocol(record.trajectory, record.name)
        return self.protocol

    def load(self) -> Record | ImpedanceSpectrum:
        """What its source holds. Raises `BsaError` if the file cannot be read."""
        from ...core.reading.reading import read_file

        if not isinstance(self.source, Path):
            return self.source
        return read_file(self.source, self.read, installed(), self.reader, self.reader_options)

    @property
    def is_life(self) -> bool:
        """Whether it is a record of equal cycles whose protocol its steps show."""
        return self.protocol == RECOGNISED and self.detailed_cycles is not None

    def as_life(self, fit_cycles: int | None = None) -> RecordRequest:
        """The same record, compared as a whole life."""
        return replace(self, protocol=RECOGNISED, detailed_cycles="auto", fit_cycles=fit_cycles)

    def parts(self) -> list[RecordRequest]:
        """A request for each part of the record whose charge is known; see `parts_between_gaps`.

        Those of a life are what is fitted and what is forecast. A spectrum has no parts.
        """
        record = self.load()
        if not isinstance(record, Record):
            if self.detailed_cycles is not None:
                raise BsaError(
                    f"{record.name} is an impedance spectrum: it is no life, and has no cycles.",
                    "fit it beside the voltage of the fresh cell, without --life.",
                )
            return [replace(self, source=record)]
        if self.is_life and record.trajectory.cycle_table is None:
            voltage, _ = _open_circuit_start(record.trajectory)
            return [replace(part, initial_voltage=voltage) for part in as_life(self, record)]
        if self.protocol is not None or self.detailed_cycles is not None:
            return [replace(self, source=record)]
        first, *others = parts_between_gaps(record)
        return [replace(self, source=first), *(replace(self, source=part, initial_soc=None) for part in others)]


def build_task(
    name: str,
    parameter_set: ParameterSource,
    records: Sequence[RecordRequest],
    model: str = "DFN",
    options: Mapping[str, Any] | None = None,
    overrides: Mapping[str, float] | None = None,
    search: str | Mapping[str, Any] = "cell",
    scale_to_capacity: bool = True,
    held_out: Sequence[RecordRequest] = (),
    ocp: str = "",
    effects: Sequence[str] = (),
) -> Task:
    """Read the records and put a task together.

    Parameters
    ----------
    parameter_set, model, options, overrides
        As in `CellModel`; the set may be ``"nearest"``: that of the positive electrode among the nearest potentials.
    search : str or mapping
        Name of a preset, or parameters with bounds.
    scale_to_capacity : bool
        Whether the electrode area is scaled when the cell is of another size than the parameter set's.
    held_out : sequence of RecordRequest
        What is not fitted, and scored after the search.
    ocp : str
        Whose open-circuit potentials the cell starts with: ``"nearest"``, a set, or two with a slash between them (see
        `chosen_potentials`); empty keeps those of the parameter set.
    effects : sequence of str
        Effects of the catalogue that the cell model has too; their parameters are searched.

    Raises
    ------
    BsaError
        If a file, a parameter set or a parameter does not exist or makes no sense.
    """
    from ...plugins.pybamm.augmentation import augmented_cell, effects_in
    from ...plugins.pybamm.model_options import in_pybamm_spelling
    from ...plugins.pybamm.parameter_sets import load
    from ...plugins.pybamm.presets import is_preset, resolve_space, starts_given
    from ...plugins.pybamm.spectrum_experiment import DOUBLE_LAYERS
    from ...plugins.pybamm.state_of_charge import equilibrium_capacity_ah, soc_at_voltage

    asked, forecast = _divided(records)
    records, spectra = _over_time(asked)
    loaded = [_as_asked(request) for request in records]
    notes = [f"{record.name}: {note}" for record in loaded for note in (*record.notes, *_too_many_cycles(record))]
    notes += [note for request in spectra for note in spectrum_notes(request)]
    own_file = isinstance(parameter_set, ParameterFile)
    parameter_set, said = _with_potentials(parameter_set, ocp, loaded)
    notes += said if effects else [*said, *_hysteresis(loaded)]
    options, said = _with_thermal_model(in_pybamm_spelling(options or {}), records, loaded)
    notes += said
    fixed = dict(overrides or {})
    if _at_several_temperatures(options, loaded) and not own_file:
        parameter_set, said = _with_activation_energies(parameter_set, search, fixed)
        notes += said
    values = load(parameter_set, fixed)
    given = starts_given(search) | set(fixed)
    as_measured = all(request.as_measured for request in records)
    capacity_ah = equilibrium_capacity_ah(parameter_set, fixed)
    if scale_to_capacity and WIDTH not in given and as_measured:
        factor, note = _size_factor(loaded, values, capacity_ah)
        if note:
            capacity_ah *= factor
            fixed[WIDTH] = float(values[WIDTH]) * factor
            fixed |= {
                name: float(values[name]) * factor**power
                for name, power in _GROWS_WITH_AREA.items()
                if name not in given and name in values
            }
            notes.append(note)
    if any(request.is_life for request in records):
        options, note = with_ageing(options)
        notes += [note] * bool(note)
    if CONTACT not in options and as_measured:
        # Tabs, leads and clamps are in every record, and in no parameter set.
        options[CONTACT] = "true"
    if any(request.protocol == RECOGNISED for request in records):
        fixed |= _wide_window(values, loaded, given)
    cell = CellModel(parameter_set, model, options, fixed, tuple(effects))
    own_effects = effects_in(cell)
    augmented_cell(cell, own_effects)  # two may ask for different things
    # The model of a spectrum alone has the double layers.
    space = resolve_space(parameter_set, search, fixed, {**options, **DOUBLE_LAYERS} if spectra else options)
    if is_preset(search):
        # A preset does not know what this person knows.
        space = ParameterSpace(tuple(parameter for parameter in space if parameter.name not in (overrides or {})))
    space = ParameterSpace((*space, *(parameter for effect in own_effects for parameter in effect.searched)))
    if RESISTANCE not in given and not values.get(RESISTANCE, 0.0):
        space = _with_contact_resistance(space, loaded, ohmic_resistances(spectra))
    experiments: list[Experiment] = []
    socs: list[float] = []
    for request, record in zip(records, loaded, strict=True):
        soc = request.initial_soc
        if soc is None and request.as_measured:
            voltage, words = _open_circuit_start(record.trajectory)
            if request.initial_voltage is not None:
                voltage, words = request.initial_voltage, f"starts at {request.initial_voltage:.3f} V"
            soc = _with_room_for(record.trajectory, soc_at_voltage(cell, voltage), capacity_ah)
            notes.append(f"{record.name}: {words}, taken as a state of charge of {soc:.3f}.")
        if soc is not None:
            socs.append(soc)
        experiments.append(
            Experiment(
                name=record.name,
                target=record.trajectory,
                protocol=request.protocol_of(record),
                scored_cycle=request.scored_cycle,
                temperature_k=request.temperature_k if request.temperature_k is not None else record.ambient_k,
                initial_soc=soc,
                detailed_cycles=() if request.detailed_cycles is None else record.trajectory.cycles,
            )
        )
    space = _with_initial_soc(space, experiments, socs, INITIAL_SOC in given, alone=len(asked) == 1)
    experiments += [spectrum_experiment(request) for request in spectra]
    by_current = all(request.protocol is None for request in records)
    compared = by_current and _warms_by(loaded) > 0.0 and options.get(THERMAL, ISOTHERMAL) != ISOTHERMAL
    signals = (*CELL.signals, *[TEMPERATURE] * compared, *(SPECTRUM if spectra else ()))
    task = Task(name, cell, space, tuple(experiments), tuple(notes), signals=signals)
    return holding_out(task, (*forecast, *held_out))


def _over_time(requests: Sequence[RecordRequest]) -> tuple[list[RecordRequest], list[RecordRequest]]:
    """The requests for records over time, and those for spectra; all are read already."""
    spectra = [request for request in requests if isinstance(request.source, ImpedanceSpectrum)]
    return [request for request in requests if not isinstance(request.source, ImpedanceSpectrum)], spectra


def _too_many_cycles(record: Record) -> list[str]:
    count = len(record.trajectory.cycles)
    if count <= _MANY_CYCLES or record.trajectory.cycle_table is not None:
        return []
    return [f"all {count} cycles are simulated as they were measured; --life compares their fade, in far less time."]


def _divided(requests: Sequence[RecordRequest]) -> tuple[list[RecordRequest], list[RecordRequest]]:
    """The parts that are fitted, and those of lives that are forecast."""
    fitted: list[RecordRequest] = []
    forecast: list[RecordRequest] = []
    for request in requests:
        parts = request.parts()
        lives = request.is_life
        fitted += parts[:1] if lives else parts
        forecast += parts[1:] if lives else []
    return fitted, forecast


def _warms_by(records: Sequence[Record]) -> float:
    """Largest change of the measured temperature in a record, K; 0 where none was measured."""
    measured = [t for record in records if (t := record.trajectory.temperature) is not None]
    return max((float(np.ptp(temperature)) for temperature in measured), default=0.0)


def _with_thermal_model(
    options: dict[str, Any], requests: Sequence[RecordRequest], records: Sequence[Record]
) -> tuple[dict[str, Any], list[str]]:
    """The model's options with a temperature where one was measured that changes, and what is to be said of it."""
    change_k = _warms_by(records)
    if change_k < _WARMS_K or THERMAL in options or any(request.protocol is not None for request in requests):
        return options, []
    return {**options, THERMAL: "lumped"}, [
        f"The measured temperature changes by {change_k:.1f} K: the model is thermal (lumped); its temperature is "
        "fitted beside the voltage (--options thermal=isothermal keeps it constant)."
    ]


def _at_several_temperatures(options: Mapping[str, Any], records: Sequence[Record]) -> bool:
    """Whether the cell is simulated at temperatures that differ: it warms, or its records do."""
    ambient = [record.ambient_k for record in records if record.ambient_k is not None]
    return options.get(THERMAL, ISOTHERMAL) != ISOTHERMAL or float(np.ptp(ambient or [0.0])) >= _WARMS_K


def _with_activation_energies(
    parameter_set: ParameterSource, search: str | Mapping[str, Any], fixed: Mapping[str, float]
) -> tuple[ParameterSource, list[str]]:
    """The parameter set with transport that depends on the temperature, and what is to be said of it."""
    from ...plugins.pybamm.activation_energies import TRANSPORT, blind_to_temperature, with_activation_energies
    from ...plugins.pybamm.presets import is_preset

    blind = tuple(name for name in blind_to_temperature(parameter_set) if name not in fixed)
    if not blind:
        return parameter_set, []
    names = ", ".join(name.split(" [")[0].lower() for name in blind)
    said = f"In {parameter_set} these do not depend on the temperature: {names}."
    if not is_preset(search):  # it may name them as the numbers that they are
        return parameter_set, [
            f"{said} A warm cell is simulated with those of a cold one, and a fast discharge that heats the cell may "
            "be predicted to end too early."
        ]
    energies = ", ".join(f"{TRANSPORT[name].energy / 1e3:g}" for name in blind)
    return with_activation_energies(parameter_set, blind), [
        f"{said} They get activation energies ({energies} kJ/mol, those of other published sets), at the reference "
        "temperature they stay as they are."
    ]


def _with_potentials(
    parameter_set: ParameterSource, wanted: str, records: Sequence[Record]
) -> tuple[ParameterSource, list[str]]:
    """The parameter set with the potentials that were asked for, and what is to be said of them."""
    from ...plugins.pybamm.nearest_potentials import chosen_potentials, misfit_of, with_potentials

    measured = [record.trajectory for record in records]
    words = []
    if parameter_set != NEAREST:
        own_v = misfit_of(parameter_set, measured)
        far = own_v is not None and own_v > _NEAR_POTENTIALS_V
        words = [
            f"The open-circuit potentials of {parameter_set} leave {1e3 * (own_v or 0.0):.1f} mV of the slow record"
        ]
        if not wanted:
            return parameter_set, [f"{words[0]}: --ocp nearest looks for nearer ones among the installed sets."] * far
    found = chosen_potentials(wanted or NEAREST, measured)
    taken = found[0]
    base = taken.positive if parameter_set == NEAREST else parameter_set
    left = "" if words else "leave "
    rest = "" if words else " of the slow record"
    words.append(f"{'those' if words else 'The potentials'} of {taken} {left}{1e3 * taken.rms_v:.1f} mV{rest}")
    said = f"{', '.join(words)}: they are taken, with electrodes balanced for them, and all else from {base}."
    others = "; ".join(f"{other}: {1e3 * other.rms_v:.1f} mV" for other in found[1:4])
    return with_potentials(base, taken), [said + f" The next: {others}." * bool(others)]


def _hysteresis(records: Sequence[Record]) -> list[str]:
    """What is to be said of charge and discharge that are far apart where they are slow."""
    from ...plugins.pybamm.nearest_potentials import slow_curve

    slow = slow_curve(record.trajectory for record in records)
    if slow is None or not slow.gap_v > _HYSTERESIS_V:
        return []
    return [
        f"Slow charge and discharge are {1e3 * slow.gap_v:.0f} mV apart at the same charge, more than polarisation "
        "explains: --effect ocp-hysteresis adds a hysteresis of the open-circuit voltage to the model."
    ]


def _wide_window(values: Any, records: Sequence[Record], given: Collection[str]) -> dict[str, float]:
    """Voltage cut-offs beyond all of the records; what the set calls empty and full stays."""
    voltages = np.concatenate([record.trajectory.voltage for record in records])
    wide: dict[str, float] = {}
    for side, percent, wider in (
        ("Lower", 0, min(float(values["Lower voltage cut-off [V]"]), float(voltages.min()) - _MARGIN_V)),
        ("Upper", 100, max(float(values["Upper voltage cut-off [V]"]), float(voltages.max()) + _MARGIN_V)),
    ):
        cut_off, open_circuit = f"{side} voltage cut-off [V]", f"Open-circuit voltage at {percent}% SOC [V]"
        wide |= {open_circuit: float(values.get(open_circuit, values[cut_off])), cut_off: wider}
    return {name: value for name, value in wide.items() if name not in given}


def holding_out(task: Task, requests: Sequence[RecordRequest]) -> Task:
    """The task with records that it does not fit.

    Each starts at the state of charge that its request names, or where the fitted cell shows the record's first
    open-circuit voltage. Where whole lives were fitted, they are compared as such.

    Raises `BsaError` if a file cannot be read, is fitted as well, or the task's simulator is not driven by a cell's
    record.
    """
    if not requests:
        return task
    if task.domain != CELL:
        raise BsaError(
            f'task "{task.name}" is about a {task.domain.name}, whose records no reader reads.',
            "list what it holds out under held_out in its task file.",
        )
    if task.long:
        requests = [request if request.detailed_cycles else request.as_life() for request in requests]
    requests, spectra = _over_time([part for request in requests for part in request.parts()])
    loaded = [_as_asked(request) for request in requests]
    notes = [f"{record.name} (held out): {note}" for record in loaded for note in record.notes]
    experiments = [_held_out(request, record) for request, record in zip(requests, loaded, strict=True)]
    notes += [
        f"{e.name} (held out): begins under load; it is started so that the fitted cell meets its first percent, or at "
        "its first sample if that turns out to be from before the load."
        for e in experiments
        if e.initial_voltage is not None and begins_under_load(e.target)
    ]
    experiments += [spectrum_experiment(request) for request in spectra]
    notes += [note for request in spectra for note in spectrum_notes(request, " (held out)")]
    return replace(task, held_out=(*task.held_out, *experiments), notes=(*task.notes, *notes))


def _held_out(request: RecordRequest, record: Record) -> Experiment:
    starts_at_rest = request.initial_soc is None and request.as_measured
    voltage = _resting_voltage(record.trajectory) if request.initial_voltage is None else request.initial_voltage
    return Experiment(
        name=record.name,
        target=record.trajectory,
        protocol=request.protocol_of(record),
        scored_cycle=request.scored_cycle,
        temperature_k=request.temperature_k if request.temperature_k is not None else record.ambient_k,
        initial_soc=request.initial_soc,
        initial_voltage=voltage if starts_at_rest else None,
        detailed_cycles=() if request.detailed_cycles is None else record.trajectory.cycles,
    )


def _as_asked(request: RecordRequest) -> Record:
    """A part's record: with steps that meet where they are simulated, as a cycle table where that was asked for."""
    record = request.source
    assert isinstance(record, Record)
    if record.trajectory.cycle_table is not None:
        return record
    if request.protocol == RECOGNISED:
        record = replace(record, trajectory=with_switches(record.trajectory))
    if request.detailed_cycles is None:
        return record
    wanted = None if request.detailed_cycles == "auto" else tuple(request.detailed_cycles)
    return replace(record, trajectory=long_record(record.trajectory, wanted))


def _size_factor(records: Sequence[Record], values: Any, capacity_ah: float) -> tuple[float, str]:
    """How much larger the measured cell is than the parameter set's, and a sentence if that matters."""
    window = float(values["Upper voltage cut-off [V]"]) - float(values["Lower voltage cut-off [V]"])
    spans = [
        float(np.ptp(with_switches(cycle).discharge_capacity))
        for record in records
        # Over many cycles the counted charge drifts; within one it does not matter.
        for cycle in map(record.trajectory.cycle, record.trajectory.cycles)
        # A cycle that stays in part of the voltage window says little about the capacity.
        if np.ptp(cycle.voltage) > _MOST_OF_THE_WINDOW * window
    ]
    if not spans:
        return 1.0, ""
    ratio = max(spans) / capacity_ah
    if _SAME_SIZE[0] <= ratio <= _SAME_SIZE[1]:
        return 1.0, ""
    return ratio, (
        f"The records hold {max(spans):.3g} A.h, the parameter set's cell {capacity_ah:.3g} A.h: "
        f'"{WIDTH}" starts from {ratio:.3g} times its value (--no-scale keeps it).'
    )


def _resting_voltage(record: Trajectory) -> float:
    """The open-circuit voltage that the record starts from, as near as it shows, V."""
    first = record.steps[0]
    return float(record.voltage[first.stop - 1 if first.kind is StepKind.REST else 0])


def _starts_at_rest(record: Trajectory) -> bool:
    return record.steps[0].kind is StepKind.REST or not begins_under_load(record)


def _open_circuit_start(record: Trajectory) -> tuple[float, str]:
    """The open-circuit voltage that a record starts from, V, and how it is known.

    A voltage under load is none: what the current's steps show as resistance is put back.
    """
    voltage = _resting_voltage(record)
    if _starts_at_rest(record):
        return voltage, f"starts at {voltage:.3f} V"
    current, jumps = float(record.current[0]), _jump_resistances(record)
    ohm = float(np.median(jumps)) if jumps else 0.0
    loss = f"{1e3 * ohm:.3g} mOhm at its current steps" if jumps else "no current step that would show its resistance"
    return voltage + ohm * current, (
        f"begins under load ({current:.3g} A, {voltage:.3f} V), with {loss}: the open-circuit voltage is about "
        f"{voltage + ohm * current:.3f} V (--initial-soc says it better)"
    )


def _with_room_for(record: Trajectory, soc: float, capacity_ah: float) -> float:
    """The state of charge nearest to ``soc`` from which a record that begins under load can be passed at all.

    A cell gives no more than it holds, and takes no more than it has room for. Over later cycles the count drifts.
    """
    if _starts_at_rest(record):
        return soc
    drawn = record.cycle(record.cycles[0]).discharge_capacity / capacity_ah
    lowest, highest = min(float(np.max(drawn)), 1.0), max(1.0 + float(np.min(drawn)), 0.0)
    return float(np.clip(soc, lowest, highest)) if lowest <= highest else soc


def _with_contact_resistance(
    space: ParameterSpace, records: Sequence[Record], ohmic: Sequence[float]
) -> ParameterSpace:
    """The space with a searched contact resistance started from the ohmic part of spectra, or the jumps of voltage."""
    jumps = list(ohmic) or [jump for record in records for jump in _jump_resistances(record.trajectory)]
    if RESISTANCE not in space or not jumps:
        return space
    template = space[RESISTANCE]
    started = replace(template, initial=template.project(_CONTACT_SHARE * float(np.median(jumps))))
    return ParameterSpace(tuple(started if parameter.name == RESISTANCE else parameter for parameter in space))


def _jump_resistances(record: Trajectory) -> list[float]:
    """Voltage jump over current jump where one step follows another, Ohm.

    Left out are jumps that the record shows too late, and those of a cell that is nearly empty: both hold more
    diffusion than resistance.
    """
    places = [found for step in record.steps[1:] if (found := record.measured_across(step)) is not None]
    last, first = np.array(places, dtype=np.intp).reshape(-1, 2).T
    current, voltage = record.current[first] - record.current[last], record.voltage[first] - record.voltage[last]
    large = np.abs(current) > 0.2 * np.max(np.abs(record.current), initial=1e-9)
    prompt = record.time[first] - record.time[last] <= _PROMPT_S
    nearly_empty = record.voltage[last] < record.voltage.min() + _NEARLY_EMPTY * np.ptp(record.voltage)
    shown = large & prompt & ~nearly_empty
    return [float(value) for value in -voltage[shown] / current[shown] if value > 0]


def _with_initial_soc(
    space: ParameterSpace, experiments: Sequence[Experiment], socs: Sequence[float], given: bool, alone: bool
) -> ParameterSpace:
    """The space with every searched state of charge started where its record starts, or where a person said.

    One searched ``Initial state of charge`` becomes one for each record when it is not alone. Spectra have none: each
    is that of the cell at a known voltage.
    """
    if INITIAL_SOC not in space or (experiments and not socs):
        return space
    template = space[INITIAL_SOC]
    starts = [template.initial if given else template.project(soc) for soc in socs]
    if alone and experiments:
        started = [replace(template, initial=starts[0])]
    else:
        known = [experiment.name for experiment in experiments if experiment.initial_soc is not None]
        started = [
            replace(template, name=soc_name(name), initial=start, target=InitialSoc(name))
            for name, start in zip(known, starts, strict=True)
        ]
    return ParameterSpace((*(parameter for parameter in space if parameter is not template), *started))


def parse_cycles(text: str) -> tuple[int, int]:
    """``"3"`` or ``"2-5"`` as a first and a last cycle. Raises `BsaError` if the text is neither."""
    first, _, last = text.partition("-")
    try:
        return int(first), int(last or first)
    except ValueError:
        raise BsaError(f'"{text}" is not a range of cycles.', 'write "3" or "2-5".') from None
