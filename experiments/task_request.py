"""The task of matching records of a cell, from what a person typed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import BsaError
from ..core.record import Record
from ..core.task import ParameterSource, Task
from .file_reading import FileReading
from .read_options import one_each
from .run_names import named_after

if TYPE_CHECKING:
    from .run_record import RunRecord
    from .tasks.record_request import RecordRequest


@dataclass(frozen=True)
class Records:
    """Records to be matched or predicted."""

    sources: Sequence[Path | Record]
    held_out: Sequence[Path | Record] = ()  # Are not fitted, and scored after the search.
    # How the files among them are read: once for all, or for each of them, held-out ones last.
    reads: Sequence[FileReading] = (FileReading(),)
    initial_soc: Sequence[float] = ()  # Nothing, one state of charge for all sources, or one for each.
    as_protocol: bool = False  # Whether the steps that they show are simulated, in place of the measured current.
    life: bool = False  # Whether they are whole lives: capacity by cycle and the curves of a few cycles are compared.
    fit_cycles: int | None = None  # Of a life so many cycles are fitted, the later ones held out; implies ``life``.

    @property
    def lives(self) -> bool:
        """Whether they are whole lives."""
        return self.life or self.fit_cycles is not None

    @property
    def joined(self) -> bool:
        """Whether the sources are several files of one cell."""
        files = all(isinstance(source, Path) for source in self.sources)
        return self.reads[0].options.join and files and len(self.sources) > 1

    def each_read(self) -> list[FileReading]:
        """How each source, and each record that is held out, is read.

        Raises `BsaError` if that was said for another number of records.
        """
        return one_each(self.reads, (1 if self.joined else len(self.sources)) + len(self.held_out))

    def each_soc(self, count: int) -> list[float | None]:
        """The state of charge at which each of so many sources starts; None where its voltage is to tell it.

        Raises `BsaError` if there are several, but not one for each, or one is not between 0 and 1.
        """
        wild = [soc for soc in self.initial_soc if not 0 <= soc <= 1]
        if wild:
            raise BsaError(f"an initial state of charge is {wild[0]:g}.", "give a share between 0 and 1.")
        if len(self.initial_soc) not in (0, 1, count):
            raise BsaError(
                f"{len(self.initial_soc)} initial states of charge were given for {count} records.",
                "give one for all records, or one for each, in their order.",
            )
        return list(self.initial_soc) if len(self.initial_soc) == count else [*self.initial_soc, None][:1] * count

    def requests(self) -> list[RecordRequest]:
        """What is asked of each source; files of one cell are joined.

        Raises `BsaError` if there are several states of charge, but not one for each record, or one is not between 0
        and 1.
        """
        from .tasks.record_request import RECOGNISED, RecordRequest

        sources = self._joined()
        socs = self.each_soc(len(sources))
        protocol = RECOGNISED if self.as_protocol else None
        asked = [
            RecordRequest(source, read, initial_soc=soc, protocol=protocol)
            for source, read, soc in zip(sources, self.each_read()[: len(sources)], socs, strict=True)
        ]
        return [request.as_life(self.fit_cycles) for request in asked] if self.lives else asked

    def held_out_requests(self) -> list[RecordRequest]:
        """What is asked of each record that is held out."""
        from .tasks.record_request import RecordRequest

        reads = self.each_read()
        own = reads[len(reads) - len(self.held_out) :]
        return [RecordRequest(source, read) for source, read in zip(self.held_out, own, strict=True)]

    def _joined(self) -> Sequence[Path | Record]:
        if not self.joined:
            return self.sources
        return [self.each_read()[0].joined([source for source in self.sources if isinstance(source, Path)])]


@dataclass(frozen=True)
class CellChoice:
    """Which model of which cell, and what of it is searched; None leaves the default, or what a run began with."""

    # A parameter set, a parameter file, also one that is read already, or the folder of a run.
    parameters: ParameterSource | None = None
    model: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)  # PyBaMM's model options.
    search: str | Mapping[str, Any] | None = None
    ocp: str = ""  # Whose open-circuit potentials: "nearest", a set, or NEGATIVE/POSITIVE; empty for the set's own.
    scale: bool = True  # Whether the electrode area is scaled to the records' capacity.
    # Folder of a run that this one begins from: its parameters, model, options and search stand where nothing else is
    # said.
    start_from: Path | None = None
    effects: Sequence[str] = ()  # Effects of the catalogue that the model has too; their parameters are searched.


def task_of_records(records: Records, cell: CellChoice) -> Task:
    """The task of matching records, those that are held out included.

    Raises `BsaError` if no parameter set is given, or a record, a set or a parameter makes no sense.
    """
    from .tasks.measured_cell import CellRequest
    from .tasks.parameter_source import (
        found_cell,
        parameter_source,
        read_finished,
        start_from,
        starts_left_out,
        strengths_of,
        with_its_space,
    )
    from .tasks.records import build_task

    requests, held_out = records.requests(), records.held_out_requests()
    name = named_after([request.source for request in requests])
    run: RunRecord | None = None
    overrides: Mapping[str, float] = {}
    left_out = ""
    if cell.start_from is not None:
        if cell.parameters is not None:
            raise BsaError(
                f'both a run to start from and the parameter set "{cell.parameters}" were given.', "give one of them."
            )
        run = read_finished(cell.start_from)
        source, overrides = start_from(run, cell.search)
        begun = run.task.cell
        model, options, held = cell.model or begun.model, {**begun.options, **cell.options}, begun.effects
        strengths = begun.strengths if cell.search is None else strengths_of(run, cell.effects)
    elif cell.parameters is not None:
        found = found_cell(cell.parameters, cell.effects)
        source = parameter_source(cell.parameters) if found is None else found.parameters
        model, options = cell.model or "DFN", dict(cell.options)
        held, strengths = ((), {}) if found is None else (found.effects, found.strengths)
        left_out = starts_left_out(cell.parameters, source)
    else:
        raise BsaError(
            "a record needs a parameter set to start from.",
            "add --parameters Chen2020 (NMC811), Marquis2019 or Ai2020 (LCO), Prada2013 (LFP), Ecker2015 (NMC), or "
            "nearest with a discharge at 1C or slower; bsa list parameters shows all sets.",
        )
    wanted = CellRequest(
        source,
        model,
        options,
        overrides,
        search=cell.search or ("life" if records.lives else "cell"),
        scale_to_capacity=cell.scale,
        ocp=cell.ocp,
        effects=tuple(dict.fromkeys((*held, *cell.effects))),
        strengths=strengths,
    )
    task = build_task(name, wanted, requests, held_out)
    if run is not None and cell.search is None:
        return with_its_space(task, run, bool(records.initial_soc))
    return replace(task, notes=(*task.notes, left_out)) if left_out else task
