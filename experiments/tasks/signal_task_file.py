"""A task of any simulator as a person writes it: its signals, parameters and records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, model_validator

from ...core.cell import CELL
from ...core.contracts.registry import installed
from ...core.domain import Domain
from ...core.errors import BsaError, unknown
from ...core.parameters import Parameter, ParameterSpace, Scale
from ...core.printable import listed, shown
from ...core.signals import Signal
from ...core.target import Value
from ...core.task import CellModel, Experiment, Task, Weight
from ...core.trajectory import FloatArray, Step, Trajectory
from ...core.validation import validated
from ...plugins.readers.source import load_text
from ...plugins.readers.table import find_table

TIME = "time"
_KIND = "record"
"""Kind of the one step of a record that is not cut."""


class SignalEntry(BaseModel, extra="forbid"):
    """One channel of the records."""

    name: str = Field(description="Lower-case identifier: displacement.")
    unit: str = Field("", max_length=20, description="Unit of its values and of its tolerance.")
    tolerance: float = Field(1.0, gt=0, allow_inf_nan=False, description="Mismatch that counts as one, in its unit.")
    role: Literal["observed", "driven"] = Field(
        "observed", description="Whether the match is judged by it, or the experiment imposes it."
    )
    label: str = Field("", max_length=40, description="Name for people; left out, the name with a capital.")
    shown_unit: str = Field("", max_length=20, description="Unit in which mismatches are printed.")
    shown_scale: float = Field(1.0, gt=0, allow_inf_nan=False, description="How many shown units a unit is.")
    oscillates: bool = Field(False, description="Whether it swings within a step: amplitude and lag are then told.")

    @model_validator(mode="after")
    def _judged(self) -> SignalEntry:
        if self.role == "observed" and "tolerance" not in self.model_fields_set:
            raise ValueError("an observed signal needs a tolerance")
        return self

    def signal(self) -> Signal:
        """The signal."""
        return Signal(**self.model_dump())


class ParameterEntry(BaseModel, extra="forbid"):
    """One parameter to search."""

    name: str = Field(min_length=1, max_length=80, description="The simulator's name for it.")
    initial: float = Field(description="Where the search starts.")
    bounds: tuple[float, float] = Field(description="Lower and upper bound.")
    scale: Scale = Field("linear", description="linear or log.")
    unit: str = Field("", max_length=20, description="Unit, where the name does not end with it in brackets.")

    def parameter(self) -> Parameter:
        """The parameter; a simulator knows it by its name with the unit."""
        name = f"{self.name} [{self.unit}]" if self.unit and not self.name.endswith("]") else self.name
        return Parameter(name, self.initial, *self.bounds, self.scale, Value(name))


class StepEntry(BaseModel, extra="forbid"):
    """One step of a record."""

    kind: str = Field(min_length=1, max_length=60, description="What was done: free decay.")
    until: float = Field(description="Time at which it ends, s, on the record's clock.")


class SignalRecord(BaseModel, extra="forbid"):
    """One record: a table, or its values."""

    name: str = Field("", max_length=80, description="Its name; left out, the file's.")
    data: str | None = Field(None, description="A text table, relative to the task file.")
    columns: dict[str, str] = Field(
        default_factory=dict, description="Column of time or a signal, where it is not its name."
    )
    values: dict[str, list[float]] | None = Field(None, description="In place of a table: time and signals as lists.")
    steps: list[StepEntry] = Field(default_factory=list, description="Its steps in order; left out, one for all.")
    protocol: list[list[str]] | None = Field(
        None, description="Cycles of steps that the simulator is to run; left out, the driven signals drive it."
    )

    @model_validator(mode="after")
    def _one_source(self) -> SignalRecord:
        if (self.data is None) == (self.values is None):
            raise ValueError("give either data or values")
        return self


class SignalTaskFile(BaseModel, extra="forbid"):
    """A task file that names its simulator."""

    name: str = Field(min_length=1, max_length=80, description="Short name, used for the run's folder.")
    summary: str = Field("", description="One line for the reader of the file.")
    simulator: str = Field(description="Name of the simulator, as bsa list shows it.")
    model: str = Field("", description="Which of the simulator's models; left out, named after the simulator.")
    options: dict[str, Any] = Field(default_factory=dict, description="The model's options.")
    fixed: dict[str, FiniteFloat] = Field(default_factory=dict, description="Values that are not searched.")
    signals: list[SignalEntry] = Field(
        default_factory=list, description="What is driven and observed; left out, the simulator's own signals."
    )
    parameters: list[ParameterEntry] = Field(min_length=1, description="What is searched.")
    records: list[SignalRecord] = Field(min_length=1, description="What is to be matched.")
    held_out: list[SignalRecord] = Field([], description="What is not fitted, and scored after the search.")
    weight: Weight = Field("uniform", description="robust: what is far off for a short time does not decide.")


def load_signal_task(content: Mapping[str, Any], path: Path) -> Task:
    """The task that a file's content describes, with its records read.

    The content is untrusted; records lie relative to the file, and messages name it. Raises `BsaError` naming the file,
    the key and the nearest valid key.
    """
    file = validated(SignalTaskFile, content, str(path))
    try:
        return _task(file, path.parent)
    except BsaError as error:
        raise BsaError(f"{path}: {error.message}", error.hint) from None


def _task(file: SignalTaskFile, folder: Path) -> Task:
    own = installed().find("simulator", file.simulator).entry.domain
    signals = tuple(entry.signal() for entry in file.signals)
    _check_names([signal.name for signal in signals], "signals")
    domain = own or (Domain(file.simulator) if signals else CELL)
    wanted = signals or domain.signals
    notes: list[str] = []
    experiments, held_out = (
        tuple(_experiment(record, wanted, folder, notes) for record in records)
        for records in (file.records, file.held_out)
    )
    _check_names([experiment.name for experiment in (*experiments, *held_out)], "records")
    return Task(
        file.name,
        CellModel("", file.model or file.simulator, file.options, file.fixed),
        ParameterSpace(tuple(entry.parameter() for entry in file.parameters)),
        experiments,
        tuple(notes),
        domain=domain,
        signals=wanted,
        simulator=file.simulator,
        held_out=held_out,
        weight=file.weight,
    )


def _check_names(names: Sequence[str], what: str) -> None:
    """Raise `BsaError` if two records or signals have one name: errors and curves are told by it."""
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise BsaError(f'{names.count(twice)} {what} are named "{twice}".', "give each a name of its own: name: ...")


def _experiment(record: SignalRecord, signals: Sequence[Signal], folder: Path, notes: list[str]) -> Experiment:
    names = [TIME, *(signal.name for signal in signals)]
    for given in (*record.columns, *(record.values or ())):
        if given not in names:
            message = f'"{shown(given)}" is neither time nor a signal of the task.'
            raise unknown(message, given, names, "they are {}.")
    if record.data is not None:
        name = record.name or shown(Path(record.data).name)
        columns = _table_columns(folder / record.data, {key: record.columns.get(key, key) for key in names}, notes)
    else:
        name, values = record.name or "record", record.values or {}
        missing = [key for key in names if key not in values]
        if missing:
            raise BsaError(f'record "{name}": values lack {missing}.', "give one list for time and for each signal.")
        columns = {key: np.asarray(values[key], dtype=np.float64) for key in names}
    time = columns.pop(TIME)
    if len(time) < 2:
        raise BsaError(f'record "{name}" has {len(time)} samples.', "a record needs two at least.")
    target = Trajectory(time, steps=_steps(record.steps, time, name), signals=columns)
    protocol = None if record.protocol is None else tuple(tuple(cycle) for cycle in record.protocol)
    return Experiment(name, target, protocol)


def _table_columns(path: Path, wanted: Mapping[str, str], notes: list[str]) -> dict[str, FloatArray]:
    """The wanted columns of a text table, by what they are wanted for."""
    text, said = load_text(path)
    table = find_table(text, shown(path.name))
    places: dict[str, int] = {}
    for key, column in wanted.items():
        if column not in table.header:
            raise BsaError(
                f'{table.source} has no column "{shown(column)}" for {key}.',
                f"its columns are {listed(table.header)}; name another under columns.",
            )
        places[key] = table.header.index(column)
    read = table.numbers(list(places.values()), {})
    notes += [f"{table.source}: {note}" for note in (*said, *read.notes)]
    return {key: read.values[place] for key, place in places.items()}


def _steps(entries: Sequence[StepEntry], time: FloatArray, name: str) -> tuple[Step, ...]:
    if not entries:
        return (Step(_KIND, 0, len(time)),)
    steps: list[Step] = []
    start = 0
    for place, entry in enumerate(entries):
        last = place == len(entries) - 1
        # The sample at which a step ends belongs to it; the last step takes what is left.
        stop = len(time) if last else int(np.searchsorted(time, entry.until, side="right"))
        if stop <= start:
            raise BsaError(
                f'record "{name}": the step "{shown(entry.kind)}" until {entry.until:g} s holds no sample.',
                "give the steps in order, each longer than the time between two samples.",
            )
        steps.append(Step(entry.kind, start, stop, position=place))
        start = stop
    return tuple(steps)
