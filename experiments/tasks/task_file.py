"""A calibration task as a person writes it: a short YAML file beside its records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field, FiniteFloat, model_validator
from scipy.constants import zero_Celsius

from ...core.encoding import decode_task
from ...core.errors import BsaError
from ...core.files import load_json
from ...core.protocol_text import read_protocol
from ...core.shape import decoding
from ...core.task import Task, Weight
from ...core.validation import validated
from ...core.yaml_text import YAML_SUFFIXES, read_yaml
from ..file_reading import ReadEntry
from .influence import without_use
from .measured_cell import CellRequest
from .record_request import RecordRequest
from .records import build_task
from .signal_task_file import load_signal_task

_SUFFIXES = (*YAML_SUFFIXES, ".json")


def is_task_file(path: Path | str) -> bool:
    """Whether a file is called as task files are, in letters of any size."""
    return Path(path).suffix.lower() in _SUFFIXES


class ExperimentEntry(ReadEntry):
    """One record and how it was made."""

    data: str | list[str] = Field(
        description="The record, relative to the task file; several files of one cell are joined by their dates."
    )
    protocol: list[list[str] | str] | Literal["recognised"] | None = Field(
        None,
        description='Cycles of PyBaMM step strings, or "200 x [step, step]"; recognised: as the record\'s steps show; '
        "left out, the measured current drives the model.",
    )
    scored_cycle: int | None = Field(None, ge=1, description="The cycle to be matched; left out, the whole record.")
    detailed_cycles: list[int] | Literal["auto"] | None = Field(
        None,
        description="Of a record of many cycles: which are compared by their curves, all others by capacity and "
        "resistance alone; auto chooses them.",
    )
    fit_cycles: int | None = Field(
        None,
        ge=1,
        description="Of a life whose protocol is recognised: how many cycles are fitted; later ones are held out.",
    )
    temperature_degc: float | None = Field(None, gt=-100, lt=200, description="Ambient temperature in degC.")
    initial_soc: float | None = Field(None, ge=0, le=1, description="Initial state of charge.")

    @property
    def files(self) -> list[str]:
        """The names of the record's files."""
        return [self.data] if isinstance(self.data, str) else self.data

    @model_validator(mode="after")
    def _divided(self) -> ExperimentEntry:
        if self.fit_cycles is not None and (self.protocol != "recognised" or self.detailed_cycles is None):
            raise ValueError("fit_cycles goes with protocol: recognised and detailed_cycles: auto")
        return self


class TaskFile(BaseModel, extra="forbid"):
    """A task file."""

    name: str = Field(min_length=1, max_length=80, description="Short name, used for the run's folder.")
    summary: str = Field("", description="One line for bsa list.")
    parameter_set: str = Field(description="PyBaMM parameter set to start from.")
    model: str = Field("DFN", description="SPM, SPMe or DFN.")
    options: dict[str, Any] = Field(default_factory=dict, description="PyBaMM model options.")
    overrides: dict[str, FiniteFloat] = Field(
        default_factory=dict, description="Values that replace those of the set and are not searched."
    )
    ocp: str = Field(
        "",
        description="Whose open-circuit potentials to start from: nearest, a set, or NEGATIVE/POSITIVE; left out, "
        "those of the parameter set.",
    )
    effects: list[str] = Field([], description="Effects of the catalogue that the model has too: ocp-hysteresis.")
    search: str | dict[str, Any] = Field(description="A preset's name, or parameters with bounds.")
    experiments: list[ExperimentEntry] = Field(min_length=1, description="The records to match.")
    held_out: list[ExperimentEntry] = Field([], description="Records that are not fitted, and scored after the search.")
    weight: Weight = Field("uniform", description="robust: what is far off for a short time does not decide.")


def load_task_file(path: Path) -> Task:
    """Read a task file and its records.

    A file that names a simulator describes signals, parameters and records of any kind (`SignalTaskFile`); one that
    does not describes a cell (`TaskFile`). JSON may also hold a task as `bsa.core.encoding.encode_task` writes it.

    Raises `BsaError` naming the file, the key and the nearest valid key.
    """
    is_json = path.suffix.lower() == ".json"
    found = load_json(path, "check it there.") if is_json else read_yaml(path)
    if isinstance(found, dict) and "simulator" in found and "space" not in found:
        return load_signal_task(found, path)
    if isinstance(found, dict) and is_json and "space" in found:
        return _encoded(found, path)
    content = validated(TaskFile, found, str(path))
    try:
        return task_from(content, path.parent)
    except BsaError as error:
        raise BsaError(f"{path}: {error.message}", error.hint) from None


def task_from(content: TaskFile, folder: Path) -> Task:
    """The task of a task file whose records lie in a folder.

    Raises `BsaError` if a record, a parameter set or a parameter does not exist or makes no sense.
    """
    cell = CellRequest(
        content.parameter_set,
        content.model,
        content.options,
        content.overrides,
        content.search,
        ocp=content.ocp,
        effects=content.effects,
    )
    records = [_request(entry, folder) for entry in content.experiments]
    task = build_task(content.name, cell, records, [_request(entry, folder) for entry in content.held_out])
    notes = (*task.notes, *without_use(task.cell, content.overrides))
    return replace(task, weight=content.weight, notes=notes)


def _request(entry: ExperimentEntry, folder: Path) -> RecordRequest:
    reading = entry.reading
    if entry.temperature_degc is not None:  # a reader need not guess it
        known = entry.read.model_copy(update={"ambient_c": entry.temperature_degc})
        reading = replace(reading, options=known)
    return RecordRequest(
        source=reading.joined([folder / name for name in entry.files]),
        reading=reading,
        protocol=read_protocol(entry.protocol) if isinstance(entry.protocol, list) else entry.protocol,
        scored_cycle=entry.scored_cycle,
        detailed_cycles=entry.detailed_cycles,
        fit_cycles=entry.fit_cycles,
        temperature_k=None if entry.temperature_degc is None else entry.temperature_degc + zero_Celsius,
        initial_soc=entry.initial_soc,
    )


def _encoded(content: dict[str, Any], path: Path) -> Task:
    hint = "write it with bsa.core.encoding.encode_task, or give a .yaml task file."
    with decoding(path, "an encoded task", hint):
        return decode_task(content)
