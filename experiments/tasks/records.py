"""From measured records to a task: what to search, at which size, from which state of charge."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path

from ...core.ageing.long_record import long_record
from ...core.cell import CELL, SPECTRUM, TEMPERATURE
from ...core.errors import BsaError
from ...core.parameters import Parameter, ParameterSpace
from ...core.reading.switches import begins_under_load, resting_voltage, without_mixed_samples
from ...core.record import Record
from ...core.segmentation.recognised_protocol import with_switches
from ...core.spectrum import ImpedanceSpectrum
from ...core.target import INITIAL_SOC
from ...core.task import CellModel, Experiment, Task
from ...core.trajectory import Trajectory
from .cell_for_records import TELLS_K, apart_k, is_thermal, warms_by
from .cell_size import other_size_note
from .current_offsets import searched_offset, without_current_offset
from .initial_states import KnownStart, with_searched_starts
from .measured_cell import CellRequest, MeasuredCell, measured_cell, searched_space
from .record_request import RECOGNISED, RecordRequest
from .record_start import open_circuit_start, starts_at_rest, with_room_for
from .sensor_offset import from_ambient, initial_temperature_k, start_note
from .spectra import spectrum_experiment, spectrum_notes

_MANY_CYCLES = 50
"""Cycles from which on a record is more likely meant as a life: each simulation of so many takes minutes."""

_BESIDE_V = 0.01
"""Voltage over which the slope of an open-circuit curve is taken: wide enough to level the noise of tabulated ones."""


@dataclass(frozen=True)
class MeasuredExperiments:
    """Records as experiments on the cell that is to match them."""

    cell: MeasuredCell
    records: list[Record]  # Those over time.
    experiments: list[Experiment]  # One for each of them.
    starts: list[KnownStart | None]  # Where each of them starts; None where nothing is known of it.
    offsets: list[Parameter]  # What the currents of those may be off by that did not bring their charge back.
    spectra: list[RecordRequest]  # Impedance spectra, read.
    held_out: list[RecordRequest]  # What is not fitted, read, with what is forecast of lives.
    notes: list[str]  # What is to be said of records and cell.
    start_notes: list[str]  # What is to be said of where the experiments start.


def measured_experiments(
    wanted: CellRequest, records: Sequence[RecordRequest], held_out: Sequence[RecordRequest] = ()
) -> MeasuredExperiments:
    """Read the records and settle the cell that is to match them; see `build_task`."""
    asked, forecast = _divided(records)
    records, spectra = _over_time(asked)
    loaded = [_as_asked(request) for request in records]
    held_out = [replace(request, source=request.load()) for request in held_out]
    later = [request.source for request in held_out if isinstance(request.source, Record)]
    cell = measured_cell(wanted, records, loaded, later)
    _check_effects(cell.model, [*asked, *forecast, *held_out])
    experiments, starts, said = _fitted(records, loaded, cell)
    notes = [
        *(
            f"{request.whole_name or record.name}: {note}"
            for request, record in zip(records, loaded, strict=True)
            for note in (*record.notes, *_too_many_cycles(record))
        ),
        *(note for request in spectra for note in spectrum_notes(request, cell.model)),
        *cell.notes,
    ]
    off = [searched_offset(request, record.name) for request, record in zip(records, loaded, strict=True)]
    offsets = [offset for offset in off if offset is not None]
    return MeasuredExperiments(cell, loaded, experiments, starts, offsets, spectra, [*forecast, *held_out], notes, said)


def build_task(
    name: str, wanted: CellRequest, records: Sequence[RecordRequest], held_out: Sequence[RecordRequest] = ()
) -> Task:
    """Read the records and put a task together.

    Parameters
    ----------
    wanted : CellRequest
        The cell, and what of it is searched.
    records, held_out : sequence of RecordRequest
        What is fitted, and what is not and is scored after the search.

    Raises
    ------
    BsaError
        If a file, a parameter set or a parameter does not exist or makes no sense.
    """
    found = measured_experiments(wanted, records, held_out)
    cell, spectra = found.cell.model, found.spectra
    space, left_out = searched_space(wanted, cell, found.records, spectra)
    alone = len(found.experiments) + len(spectra) == 1
    space, over_time = with_searched_starts(space, found.experiments, found.starts, INITIAL_SOC in wanted.given, alone)
    if space.prior_weights.any():
        space = ParameterSpace((*space, *(offset for offset in found.offsets if offset.name not in space)))
    by_current = all(experiment.protocol is None for experiment in found.experiments)
    compared = by_current and warms_by(found.records) > 0.0 and is_thermal(cell.options)
    signals = (*CELL.signals, *[TEMPERATURE] * compared, *(SPECTRUM if spectra else ()))
    experiments = (*over_time, *(spectrum_experiment(request) for request in spectra))
    notes = (*found.notes, *left_out, *found.start_notes)
    return holding_out(Task(name, cell, space, experiments, notes, signals=signals), found.held_out)


def _fitted(
    requests: Sequence[RecordRequest], records: Sequence[Record], cell: MeasuredCell
) -> tuple[list[Experiment], list[KnownStart | None], list[str]]:
    """The records as experiments, where they start, and what is to be said of both."""
    experiments: list[Experiment] = []
    starts: list[KnownStart | None] = []
    notes: list[str] = []
    for request, record in zip(requests, records, strict=True):
        start = None if request.initial_soc is None else KnownStart(request.initial_soc)
        if start is None and request.as_measured:
            start, words = _shown_start(request, record, _as_warm(record, records), cell)
            notes.append(f"{record.name}: {words}, taken as a state of charge of {start.soc:.3f}.")
        starts.append(start)
        experiments.append(_experiment(request, record, None if start is None else start.soc))
        notes += start_note(record.name, record.trajectory, experiments[-1])
    return experiments, starts, notes


def _shown_start(
    request: RecordRequest, record: Record, others: Sequence[Trajectory], cell: MeasuredCell
) -> tuple[KnownStart, str]:
    """Where a record starts by its first voltage, and how that is known."""
    from ...plugins.pybamm.cells.state_of_charge import socs_at_voltages

    voltage, words = open_circuit_start(record.trajectory, others)
    at_rest = starts_at_rest(record.trajectory, others)
    if request.initial_voltage is not None:
        voltage, words, at_rest = request.initial_voltage, f"starts at {request.initial_voltage:.3f} V", True
    around = (voltage - _BESIDE_V, voltage, voltage + _BESIDE_V)
    low, soc, high = socs_at_voltages(cell.model, around, _starting_k(request, record))
    slope = max(soc - low, high - soc) / _BESIDE_V
    soc = with_room_for(record.trajectory, soc, cell.capacity_ah, others)
    return KnownStart(soc, voltage if at_rest else None, slope), words


def _as_warm(record: Record, records: Sequence[Record]) -> list[Trajectory]:
    """The other records at nearly the same temperature, at which the cell has nearly the same resistance."""
    others = (other for other in records if other is not record)
    return [other.trajectory for other in others if apart_k([record, other]) < TELLS_K]


def _check_effects(cell: CellModel, requests: Sequence[RecordRequest]) -> None:
    """Refuse effects that act on a measured current where a protocol is simulated."""
    from ...plugins.pybamm.augmentation import refuse_current_effects

    if any(request.protocol is not None for request in requests):
        refuse_current_effects(cell)


def _initial_k(request: RecordRequest, record: Record) -> float | None:
    """The temperature of the cell at the start, K; None for the ambient one, where a protocol always starts."""
    return initial_temperature_k(record.trajectory, record.ambient_k) if request.protocol is None else None


def _starting_k(request: RecordRequest, record: Record) -> float | None:
    own = _initial_k(request, record)
    return record.ambient_k if own is None else own


def _over_time(requests: Sequence[RecordRequest]) -> tuple[list[RecordRequest], list[RecordRequest]]:
    """The requests for records over time, and those for spectra; all are read already."""
    spectra = [request for request in requests if isinstance(request.source, ImpedanceSpectrum)]
    return [request for request in requests if not isinstance(request.source, ImpedanceSpectrum)], spectra


def _too_many_cycles(record: Record) -> list[str]:
    count = len(record.trajectory.cycles)
    if count <= _MANY_CYCLES or record.trajectory.cycle_table is not None:
        return []
    return [f"all {count} cycles are simulated as they were measured; --life compares their fade, in far less time."]


def _with_own_names(requests: Sequence[RecordRequest], others: Sequence[Experiment] = ()) -> list[RecordRequest]:
    """The same records, numbered where another has the name already: two folders may hold files of one name.

    A record that is there twice keeps its name. All are read already.
    """
    measured = {one.name: one.target for one in others if not one.is_spectrum}
    taken = {one.name for one in others}
    named: list[RecordRequest] = []
    for request in requests:
        source = request.source
        assert not isinstance(source, Path)
        own = source.trajectory if isinstance(source, Record) else None
        names = chain([source.name], (f"{source.name} ({number})" for number in count(2)))
        name = next(name for name in names if name not in taken or _is_there_twice(measured.get(name), own))
        taken.add(name)
        if own is not None:
            measured[name] = own
        named.append(replace(request, source=replace(source, name=name)))
    return named


def _is_there_twice(known: Trajectory | None, own: Trajectory | None) -> bool:
    return known is not None and own is not None and known.is_same_measurement(own)


def _divided(requests: Sequence[RecordRequest]) -> tuple[list[RecordRequest], list[RecordRequest]]:
    """The parts that are fitted, and those of lives that are forecast."""
    fitted: list[RecordRequest] = []
    forecast: list[RecordRequest] = []
    for request in requests:
        parts = request.parts()
        count = 1 if request.is_life else len(parts)
        fitted += parts[:count]
        forecast += parts[count:]
    fitted = _with_own_names(fitted)
    names = [request.source.name for request in fitted if not isinstance(request.source, Path)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise BsaError(f'record "{twice[0]}" is given twice.', "give each record once.")
    return fitted, forecast


def holding_out(task: Task, requests: Sequence[RecordRequest], what_to_do: str = "give it as one of the two.") -> Task:
    """The task with records that it does not fit.

    Each starts at the state of charge that its request names, or where the fitted cell shows the record's first
    open-circuit voltage. Where whole lives were fitted, they are compared as such.

    Raises `BsaError` if a file cannot be read, is fitted as well (``what_to_do`` is then the hint), or the task's
    simulator is not driven by a cell's record.
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
    parts = [part for request in requests for part in request.parts()]
    requests, spectra = _over_time(_with_own_names(parts, (*task.experiments, *task.held_out)))
    loaded = [_as_asked(request) for request in requests]
    fitted = {experiment.name for experiment in task.experiments}
    for record in loaded:
        if record.name in fitted:
            raise BsaError(f'the record "{record.name}" is fitted, so that its errors are no prediction.', what_to_do)
    notes = [
        f"{request.whole_name or record.name} (held out): {note}"
        for request, record in zip(requests, loaded, strict=True)
        for note in record.notes
    ]
    _check_effects(task.cell, requests)
    experiments = [_held_out(request, record) for request, record in zip(requests, loaded, strict=True)]
    for record, experiment in zip(loaded, experiments, strict=True):
        notes += start_note(f"{record.name} (held out)", record.trajectory, experiment)
    notes += _other_sizes(task.cell, loaded)
    notes += [
        f"{e.name} (held out): begins under load; it is started so that the fitted cell meets its first percent, or at "
        "its first sample if that turns out to be from before the load."
        for e in experiments
        # Of a life the first cycle is simulated first, whichever is compared.
        if e.initial_voltage is not None and not e.long and begins_under_load(e.target)
    ]
    experiments += [spectrum_experiment(request) for request in spectra]
    notes += [note for request in spectra for note in spectrum_notes(request, task.cell, " (held out)")]
    return replace(task, held_out=(*task.held_out, *experiments), notes=(*task.notes, *notes))


def _other_sizes(cell: CellModel, records: Sequence[Record]) -> list[str]:
    """Which records hold clearly more or less charge than the cell that is to predict them."""
    if not cell.parameter_set or not records:
        return []
    from ...plugins.pybamm.cells.nameplate import nominal_capacity_ah
    from ...plugins.pybamm.cells.parameter_sets import load

    values, capacity_ah = load(cell.parameter_set), nominal_capacity_ah(cell.parameter_set, cell.overrides)
    said = ((record.name, other_size_note(record, values, capacity_ah)) for record in records)
    return [f"{name} (held out): {note}" for name, note in said if note]


def _held_out(request: RecordRequest, record: Record) -> Experiment:
    starts_at_rest = request.initial_soc is None and request.as_measured
    voltage = resting_voltage(record.trajectory) if request.initial_voltage is None else request.initial_voltage
    return _experiment(request, record, request.initial_soc, voltage if starts_at_rest else None)


def _experiment(
    request: RecordRequest, record: Record, initial_soc: float | None, initial_voltage: float | None = None
) -> Experiment:
    target, scored_cycle = record.trajectory, request.scored_cycle
    if request.protocol is None:
        target = from_ambient(target, record.ambient_k)
    elif target.cycle_table is None:
        target, scored_cycle = _as_simulated(target, scored_cycle)
    return Experiment(
        name=record.name,
        target=target,
        protocol=request.protocol_of(record),
        scored_cycle=scored_cycle,
        temperature_k=record.ambient_k,
        initial_soc=initial_soc,
        initial_voltage=initial_voltage,
        detailed_cycles=() if request.detailed_cycles is None else record.trajectory.cycles,
        initial_temperature_k=_initial_k(request, record),
    )


def _as_simulated(target: Trajectory, scored_cycle: int | None) -> tuple[Trajectory, int | None]:
    """A record with its cycles counted from 1, as those of a simulated protocol are, and the one that is scored.

    A number that the record does not have stays as it is, to be refused with the task.
    """
    number = {cycle: place for place, cycle in enumerate(target.cycles, start=1)}
    steps = tuple(replace(step, cycle=number[step.cycle]) for step in target.steps)
    wanted = number.get(scored_cycle, scored_cycle) if scored_cycle is not None else None
    return target.picked(slice(None), steps), wanted


def _as_asked(request: RecordRequest) -> Record:
    """A part's record: with steps that meet where they are simulated, as a cycle table where that was asked for."""
    record = request.source
    assert isinstance(record, Record)
    if record.trajectory.cycle_table is not None:
        return record
    record = without_current_offset(request, record)
    if request.reading.options.voltage_lag_s != 0.0:  # with 0 the record stays as it is
        record = without_mixed_samples(record)
    if request.protocol == RECOGNISED:
        record = replace(record, trajectory=with_switches(record.trajectory))
    if request.detailed_cycles is None:
        return record
    wanted = None if request.detailed_cycles == "auto" else tuple(request.detailed_cycles)
    return replace(record, trajectory=long_record(record.trajectory, wanted))
