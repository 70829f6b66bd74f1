"""What a discovery is asked: records, base model, and how hard to look."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, Field, model_validator
from scipy.constants import zero_Celsius

from ..core.contracts.requests import MeasuredRecord
from ..core.errors import BsaError, unknown
from ..core.files import write_text
from ..core.inference.observations import FLOOR_V
from ..core.record import Record
from ..core.run.journal import FILE_NAME, check_run_folder
from ..core.target import CyclableLithium, Factor, Value, factor_name, target_named
from ..core.task import CellModel, Experiment, ParameterSource, Task
from ..core.validation import validated
from ..core.yaml_text import YAML_SUFFIXES, read_yaml
from .file_reading import FileReading, ReadEntry
from .run_names import named_after, numbered_folder
from .task_request import Records
from .tasks.influence import no_influence
from .tasks.parameter_source import run_named

if TYPE_CHECKING:
    from .tasks.parameter_source import FoundCell
    from .tasks.record_request import RecordRequest


class RecordFile(ReadEntry):
    """A record to read."""

    path: Path = Field(description="The cycler's file, or a folder of one cell's files.")
    joined: list[Path] = Field(default=[], description="Further files of the same cell, joined with it by date.")

    @model_validator(mode="before")
    @classmethod
    def _from_path(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, (str, Path)) else value

    @property
    def files(self) -> list[Path]:
        """All of its files."""
        return [self.path, *self.joined]


class Uncertainty(BaseModel, extra="forbid"):
    """How far one factor may be off."""

    spread: float = Field(gt=0, description="Prior standard deviation of its logarithm.")
    lower: float = Field(gt=0, lt=1, description="Lower bound.")
    upper: float = Field(gt=1, description="Upper bound.")


class SearchFile(BaseModel, extra="forbid"):
    """What is uncertain, as a user writes it."""

    factors: dict[str, Uncertainty | None] = Field(
        min_length=1, description='Factors of parameters, "NAME factor"; without details, the default ones.'
    )


class DiscoverOptions(BaseModel, extra="forbid"):
    """What to look at, and how hard."""

    data: list[RecordFile] = Field(min_length=1, description="Records to explain.")
    life: bool = Field(default=False, description="Whether the record is a whole life: which mechanism ages the cell.")
    fit_cycles: int | None = Field(
        default=None, ge=1, description="Of a life so many cycles are fitted, the later ones held out."
    )
    holdout: list[RecordFile] = Field(default=[], description="Records that are predicted and never fitted.")
    reference: list[RecordFile] = Field(
        default=[],
        description="Earlier records of the same tests on the same cell, in the order of fitted and held-out records, "
        "once or several times: what the base model lacks of them counts as known.",
    )
    initial_soc: list[float | None] = Field(
        default=[],
        description="State of charge at which each fitted record starts, and its fit; none or null: by its voltage.",
    )
    parameters: str = Field(description="What to start from: a PyBaMM parameter set, a BPX or JSON file, or a run.")
    model: str = Field(default="DFN", description="SPM, SPMe or DFN.")
    options: dict[str, Any] = Field(default={}, description="PyBaMM model options of the base model.")
    overrides: dict[str, float] = Field(default={}, description="Parameter values that are known better.")
    scale: bool = Field(default=True, description="Scale the electrode area to the records' capacity.")
    ambient_c: float | None = Field(default=None, description="Ambient temperature in degC, where records lack it.")
    search: str | dict[str, Uncertainty | None] = Field(
        default="all",
        description="Uncertain parameters of the base model: a preset, a YAML file, or factors by name.",
    )
    effects: list[str] | None = Field(default=None, description="Effects to consider; left out, the whole catalogue.")
    effect_options: dict[str, Any] = Field(
        default={}, description='Options of effects: "EFFECT.KEY" for one, "KEY" for all that have it.'
    )
    backend: str | None = Field(default=None, description="Language model that ranks effects too.")
    backend_options: dict[str, Any] = Field(default={}, description="How it is reached and asked: its own options.")
    hide_names: bool = Field(default=False, description="Show the language model effects under names without meaning.")
    max_effects: int = Field(default=2, ge=1, le=2, description="Effects in one explanation at most.")
    seed: int = Field(default=0, ge=0, description="Seed for everything random.")
    notes: list[str] = Field(default=[], description="What was assumed or repaired in records that were read already.")
    points: int = Field(default=400, ge=60, description="Averages that each record is condensed to.")
    floor_mv: float = Field(default=1e3 * FLOOR_V, gt=0, description="Differences below this are not physics, mV.")
    out: Path = Field(description="Folder for discovery.json, report.html and augmented_model.py.")

    @property
    def files(self) -> list[RecordFile]:
        """All records that are read: fitted and held-out ones, and references."""
        return [*self.data, *self.holdout, *self.reference]


def discover_options(
    records: Records,
    out: Path | None,
    *,
    parameters: ParameterSource,
    reference: Sequence[Path | Record] = (),
    **others: Any,
) -> DiscoverOptions:
    """What is asked of a discovery.

    Files among the references are read as all records are. Records and parameters that were read already are written
    into the folder ``OUT-records`` beside that of the discovery, so that it can be resumed; ``out`` is a new folder
    under ``runs`` where it is None. Raises `BsaError` if an option is wrong.
    """
    if records.lives:
        _check_life(records, {**others, "reference": reference})
    folder = out or numbered_folder(Path("runs"), f"{named_after(records.sources[:1])}-discover")
    check_run_folder(folder)
    count, reads = len(records.sources), records.each_read()
    if records.joined:
        reads = [reads[0]] * count + reads[1:]
    if not all(isinstance(one, Record) for one in reference):
        reads += [reading_of_references(records.reads)] * len(reference)
    files: list[dict[str, Any]] = []
    notes: list[str] = []  # of records that were read already
    for number, one in enumerate((*records.sources, *records.held_out, *reference), 1):
        if isinstance(one, Record):
            path = _written(one, number, folder)
            files.append({"path": path})
            notes += [f"{path.name}: {note}" for note in one.notes]
        else:
            files.append({"path": one, **reads[number - 1].written})
    fitted, later = files[:count], files[count:]
    if records.joined:
        fitted = [{**fitted[0], "joined": [file["path"] for file in fitted[1:]]}]
    held_out, earlier = later[: len(records.held_out)], later[len(records.held_out) :]
    content = {"data": fitted, "holdout": held_out, "reference": earlier, "notes": notes, "out": folder, **others}
    content["parameters"] = _parameters_written(parameters, folder)
    if content.get("search") is None:
        content["search"] = "all" if records.lives else usual_search(content["parameters"], earlier)
    content |= {"life": records.lives, "fit_cycles": records.fit_cycles}
    if records.initial_soc:
        content["initial_soc"] = records.each_soc(len(fitted))
    return validated(DiscoverOptions, content, "discovery")


def reading_of_references(reads: Sequence[FileReading]) -> FileReading:
    """How references are read: as all records are. Raises `BsaError` if records are read differently."""
    if len(reads) > 1:
        raise BsaError(
            "records that are read differently were given with --reference.",
            "write them in one format first: bsa data FILE --export bdf.",
        )
    return reads[0]


def usual_search(parameters: str, reference: Sequence[Any] | None = ()) -> str:
    """What is uncertain where nobody says it: less of a run, which has fitted what a published set may be wrong by.

    With references only what the cell may have become since.
    """
    if reference:
        return "unchanged"
    return "all" if run_named(parameters) is None else "measured"


def _check_life(records: Records, others: Mapping[str, Any]) -> None:
    """Refuse what is not asked of a life."""
    count = len(records.sources)
    if count > 1 and not records.joined:
        raise BsaError(f"{count} lives were given.", "give one, or --join the files of one cell; each is its own.")
    for name, given, instead in (
        ("reference", bool(others.get("reference")), "its first cycle is the reference of the others."),
        ("holdout", bool(records.held_out), "later cycles than --fit-cycles are held out."),
        (
            "search",
            others.get("search") not in (None, "all"),
            "its cell is fitted to the first cycle, by the preset cell.",
        ),
        ("backend", others.get("backend") is not None, "every mechanism is fitted, and needs no rank."),
    ):
        if given:
            raise BsaError(f"--{name} cannot be given with --life.", f"leave it out: {instead}")


def _written(record: Record, number: int, folder: Path) -> Path:
    """A record as a file, which a discovery that is resumed reads again; it is never replaced by another record."""
    from ..plugins.readers.bdf import write

    place = _place_of_records(folder)
    place.mkdir(parents=True, exist_ok=True)
    name = "".join(
        character if character.isalnum() or character in "-_" else "-" for character in Path(record.name).stem
    )
    path = place / f"{number}-{name[:60]}.csv"
    if not _is_resumed(path, folder):
        write(record, path)
        return path
    with TemporaryDirectory() as drafts:
        draft = Path(drafts) / path.name
        write(record, draft)
        if not filecmp.cmp(draft, path, shallow=False):
            raise _belongs_to_another(folder, "records")
    return path


def _parameters_written(parameters: ParameterSource, folder: Path) -> str:
    """What names the parameters: of those that were read already, the path of a file with them."""
    if isinstance(parameters, str):
        return parameters
    path = _place_of_records(folder) / "parameters.json"
    if _is_resumed(path, folder) and path.read_text(encoding="utf-8") != parameters.text:
        raise _belongs_to_another(folder, "parameters")
    write_text(path, parameters.text)
    return str(path)


def _place_of_records(folder: Path) -> Path:
    """Where what was read already is written, beside the folder of the discovery."""
    return folder.with_name(f"{folder.name}-records")


def _is_resumed(path: Path, folder: Path) -> bool:
    """Whether a discovery in the folder was begun with the file."""
    return path.is_file() and (folder / FILE_NAME).is_file()


def _belongs_to_another(folder: Path, of_other: str) -> BsaError:
    return BsaError(f"{folder} belongs to a discovery with other {of_other}.", "choose another --out folder.")


@dataclass(frozen=True)
class Case:
    """A discovery's input, read."""

    cell: CellModel  # The base model.
    # measured_records, held: Records to fit and to predict.
    measured_records: tuple[MeasuredRecord, ...]
    held: tuple[MeasuredRecord, ...] = ()
    # By record, where the search for its initial state of charge starts.
    initial_soc: Mapping[str, float] | None = None
    notes: tuple[str, ...] = ()  # What was assumed or repaired.
    # Where the parameters of the effects that the base model has are searched from, by full name.
    strengths: Mapping[str, float] = field(default_factory=dict)
    known_v: float = 0.0  # What the run that the base model comes from left of its own records, V.
    # By record, the fitted ones first, an earlier one of the same test; none, or one for each.
    references: tuple[MeasuredRecord, ...] = ()


def read_case(options: DiscoverOptions) -> Case:
    """Read the records and settle the base model: size, ambient temperature, initial states of charge."""
    from ..plugins.pybamm.cells.model_options import in_pybamm_spelling
    from .tasks.cell_for_records import ISOTHERMAL, THERMAL
    from .tasks.measured_cell import CONTACT, CellRequest
    from .tasks.parameter_source import found_cell, parameter_source
    from .tasks.records import measured_experiments

    run = found_cell(options.parameters)
    model_options = ({} if run is None else dict(run.options)) | in_pybamm_spelling(options.options)
    fitted = [named for file, soc in _started(options) for named in _parts(options, file, soc)]
    held = [named for file in options.holdout for named in _parts(options, file)]
    wanted = CellRequest(
        parameter_source(options.parameters) if run is None else run.parameters,
        options.model,
        # Whether heat is missing is for the discovery to find.
        {THERMAL: ISOTHERMAL, **model_options},
        options.overrides,
        search={},  # what is uncertain is the discovery's own
        scale_to_capacity=options.scale,
    )
    earlier = [named for file in options.reference for named in _parts(options, file)]
    if len(earlier) % (len(fitted) + len(held)):
        raise BsaError(
            f"{len(earlier)} references were given for {len(fitted) + len(held)} records.",
            "give an earlier record of the same test for each of --data and --holdout, in their order; then, if there "
            "are more, a second one for each.",
        )
    found = measured_experiments(wanted, [request for _, request in (*fitted, *held)])
    names = _told_apart([name for name, _ in (*fitted, *held, *earlier)])
    measured_records = _as_measured(names, found.experiments)
    references = measured_experiments(wanted, [request for _, request in earlier]).experiments if earlier else ()
    starts = {s.name: e.initial_soc for s, e in zip(measured_records, found.experiments, strict=True)}
    count, base = len(fitted), found.cell.model
    # A calibration task may add options for what it searches; here the base model is what was asked for.
    effects = () if run is None else run.effects
    cell = CellModel(base.parameter_set, options.model, model_options, base.overrides, effects)
    return Case(
        cell if model_options.get(CONTACT) == "true" else _without_resistance(cell),
        tuple(measured_records[:count]),
        tuple(measured_records[count:]),
        {name: soc for name, soc in starts.items() if soc is not None},
        _said_once(options.notes, _of_run_notes(run, options.options, bool(earlier)), found.notes, found.start_notes),
        {} if run is None else run.strengths,
        0.0 if run is None else run.left_v,
        tuple(_as_measured(names[len(measured_records) :], references)),
    )


def _as_measured(names: Sequence[str], experiments: Sequence[Experiment]) -> list[MeasuredRecord]:
    return [
        MeasuredRecord(name, experiment.target, experiment.temperature_k, experiment.initial_temperature_k)
        for name, experiment in zip(names, experiments, strict=False)
    ]


def _without_resistance(cell: CellModel) -> CellModel:
    """A cell model whose set has no contact resistance that it does not use: an effect would begin with that one."""
    from ..plugins.pybamm.cells.parameter_sets import load
    from .tasks.measured_cell import RESISTANCE

    if RESISTANCE in cell.overrides or not load(cell.parameter_set, cell.overrides).get(RESISTANCE, 0.0):
        return cell
    return replace(cell, overrides={**cell.overrides, RESISTANCE: 0.0})


def _of_run_notes(run: FoundCell | None, asked: Mapping[str, Any], has_references: bool) -> list[str]:
    """What is to be said of what a base model has from the run that it starts from."""
    if run is None:
        return []
    options = [f"{name}={value}" for name, value in run.options.items() if name not in asked]
    effects = [f"the effect {name}" for name in run.effects]
    of_model = f"The base model has what the model of the run has: {', '.join((*options, *effects))}."
    left = f"The run left {1e3 * run.left_v:.2g} mV of its own records: effects are asked to explain what is more."
    return [*[of_model] * bool(options or effects), *[left] * (not has_references)]


def read_life(options: DiscoverOptions) -> Task:
    """Read a life: the task of matching all of its cycles by a cell that does not age."""
    from .tasks.measured_cell import CellRequest
    from .tasks.parameter_source import parameter_source
    from .tasks.records import build_task

    ((file, soc),) = _started(options)
    wanted = CellRequest(
        parameter_source(options.parameters),
        options.model,
        {"SEI": "none", **options.options},
        options.overrides,
        scale_to_capacity=options.scale,
    )
    task = build_task(file.path.stem, wanted, [_request(options, file, soc).as_life()])
    return replace(task, notes=_said_once(options.notes, task.notes))


def _said_once(*notes: Sequence[str]) -> tuple[str, ...]:
    """Notes of records that were read already, and what their files show: what both have is said once."""
    return tuple(dict.fromkeys(chain(*notes)))


def _started(options: DiscoverOptions) -> list[tuple[RecordFile, float | None]]:
    """The fitted records, each with the state of charge at which it was said to start."""
    return list(zip(options.data, options.initial_soc or [None] * len(options.data), strict=True))


def _request(options: DiscoverOptions, file: RecordFile, soc: float | None = None) -> RecordRequest:
    from .tasks.record_request import RecordRequest

    ambient_c = file.read.ambient_c if options.ambient_c is None else options.ambient_c
    temperature_k = None if ambient_c is None else ambient_c + zero_Celsius
    source = file.reading.joined(file.files)
    asked = RecordRequest(source, file.reading, initial_soc=soc, temperature_k=temperature_k)
    found = asked.load()
    if not isinstance(found, Record):
        raise BsaError(
            f"{found.name} is an impedance spectrum; a discovery compares records over time alone.",
            "leave it out, or fit it beside them with bsa run --data.",
        )
    return replace(asked, source=found)


def _parts(options: DiscoverOptions, file: RecordFile, soc: float | None = None) -> list[tuple[str, RecordRequest]]:
    """What is asked of each part of a record whose charge is known, under a name.

    A voltage that is written late is kept so, unless a lag was given, and a current its offset: they are effects of the
    catalogue, found in all records together, and would be taken back from those alone that show them by themselves.
    """
    said = file.read
    kept = {"voltage_lag_s": said.voltage_lag_s or 0.0, "current_offset_a": said.current_offset_a or 0.0}
    file = file.model_copy(update={"read": said.model_copy(update=kept)})
    parts = _request(options, file, soc).parts()
    stem = file.path.stem
    return [(stem if len(parts) == 1 else f"{stem}, part {n}", part) for n, part in enumerate(parts, start=1)]


def _told_apart(names: Sequence[str]) -> list[str]:
    """The names of records, their number behind those that several have: two folders may hold files of one name."""
    return [f"{name} (record {n})" if names.count(name) > 1 else name for n, name in enumerate(names, start=1)]


def spreads_of(search: str | dict[str, Uncertainty | None], cell: CellModel) -> dict[str, tuple[float, float, float]]:
    """What is uncertain of a cell, from a preset, a file or factors by name.

    What a preset has and the cell's model does not depend on is left out. Raises `BsaError` if a file or a name makes
    no sense, or names such a factor.
    """
    from ..plugins.pybamm.before_search.influence import without_influence
    from ..plugins.pybamm.before_search.uncertain_parameters import PRESETS, default_spread
    from ..plugins.pybamm.cells.parameter_sets import require

    if isinstance(search, str):
        if search in PRESETS:
            known = PRESETS[search]
            idle = without_influence(cell, {name: target_named(name) for name in known})
            return {name: spread for name, spread in known.items() if name not in idle}
        if Path(search).suffix not in YAML_SUFFIXES or not Path(search).exists():
            message = f'there is no preset or file "{search}" of uncertain parameters.'
            raise unknown(message, search, PRESETS, "presets: {}; or the path of a YAML file.")
        search = validated(SearchFile, read_yaml(Path(search)), search).factors
    spreads = {}
    for name, own in search.items():
        target = target_named(name)
        if isinstance(target, (Factor, Value)):
            require(cell.parameter_set, target.name)
        if not isinstance(target, (Factor, CyclableLithium)):
            raise BsaError(f'"{name}" is not a factor.', f'write "{factor_name(name)}".')
        if without_influence(cell, {name: target}):
            raise no_influence(name, cell)
        spreads[name] = default_spread(name) if own is None else (own.spread, own.lower, own.upper)
    return spreads
