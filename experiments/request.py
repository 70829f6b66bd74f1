"""From what a person typed to what a run needs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from ..core.errors import BsaError, did_you_mean
from ..core.printable import shown
from ..core.record import ReadOptions, Record
from ..core.run_config import RunConfig
from ..core.scaffold import Scaffold, load_scaffold
from ..core.spectrum import ImpedanceSpectrum
from ..core.task import Task, Weight
from ..core.validation import validated
from ..core.yaml_text import parse_yaml
from .checked_options import FIELDS, as_celsius, as_number, as_several, by_signal

if TYPE_CHECKING:
    from .tasks.record_request import RecordRequest


Numbers: TypeAlias = "float | Sequence[float] | None"
"""One number for all records, or one for each, held-out ones last."""


@dataclass(frozen=True)
class RunRequest:
    """A run that is about to start."""

    task: Task  # What is to be matched.
    config: RunConfig  # Scaffold, budgets, seed.
    folder: Path  # Where it goes.


def run_config(
    scaffold: str | Scaffold,
    backend: str,
    backend_options: Mapping[str, Any],
    settings: Mapping[str, Any],
    simulator: str = "",
) -> RunConfig:
    """The checked configuration of a run.

    ``settings`` replace defaults: fields of `RunConfig`, or dotted paths into the scaffold (``feedback.use``);
    ``simulator`` is the task's own, for a scaffold that names none. Raises `BsaError` naming the key at fault and the
    nearest valid one.
    """
    chosen = load_scaffold(scaffold) if isinstance(scaffold, str) else scaffold
    content: dict[str, Any] = {
        "scaffold": chosen.made_for(simulator).model_dump(),
        "backend": backend,
        "backend_options": dict(backend_options),
    }
    for key, value in settings.items():
        path = key.split(".")
        # `warm_up` is a number of simulations, `warm_up.use` a part of the scaffold.
        if path[0] not in RunConfig.model_fields or (len(path) > 1 and not isinstance(content.get(path[0]), dict)):
            if path[0] not in Scaffold.model_fields:
                raise _no_setting(key)
            path = ["scaffold", *path]
        _put(content, path, value, key)
    return validated(RunConfig, content, "run configuration")


def given_budgets(**budgets: int | None) -> dict[str, int]:
    """The budgets that were given; the others are those of `RunConfig`."""
    return {key: value for key, value in budgets.items() if value is not None}


def _put(content: dict[str, Any], path: Sequence[str], value: Any, key: str) -> None:
    *parents, last = path
    place: Any = content
    for part in parents:
        if isinstance(place, dict) and part in place and place[part] is None:
            place[part] = {}  # a part of the scaffold that it leaves out
        place = place.get(part) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise _no_setting(key)
    place[last] = value


def _no_setting(key: str) -> BsaError:
    first, dot, rest = shown(key).partition(".")
    known = dict.fromkeys([*RunConfig.model_fields, *Scaffold.model_fields])
    nearest = did_you_mean(first, [name for name in known if name != first])
    return BsaError(
        f'--set {first}{dot}{rest}: there is no setting "{first}{dot}{rest}".',
        f"{nearest} "
        * bool(nearest)
        + f"Settings of a run: {', '.join(RunConfig.model_fields)}; of its scaffold: simulator, feedback, memories, "
        "warm_up and proposer, each with .use and .options.",
    )


def key_texts(pairs: Sequence[str] | None, option: str) -> dict[str, str]:
    """``["a=010", "b=x"]`` as a mapping of texts. Raises `BsaError` if a pair has no ``=``."""
    result: dict[str, str] = {}
    for pair in pairs or ():
        key, sign, value = (part.strip() for part in pair.partition("="))
        if not sign or not key:
            raise BsaError(f'{option} "{pair}" is not key=value.', f'write {option} "key=value".')
        result[key] = value
    return result


def key_values(pairs: Sequence[str] | None, option: str) -> dict[str, Any]:
    """``["a=1", "b=x"]`` as a mapping; values are read as YAML, and stay text where they are none.

    Raises `BsaError` if a pair has no ``=``.
    """
    result: dict[str, Any] = {}
    for key, text in key_texts(pairs, option).items():
        try:
            result[key] = parse_yaml(text, option)
        except BsaError:
            result[key] = text
    return result


def reading(
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    current_sign: str = "charge-positive",
    constant_current: float | None = None,
    current_offset: float = 0.0,
    voltage_lag: float | None = None,
    where: Mapping[str, Any] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    temperature: float | None = None,
    join: bool = False,
) -> ReadOptions:
    """What a person says about files. Raises `BsaError` if an option is not valid."""
    given = {
        "constant_current": constant_current,
        "current_offset": current_offset,
        "voltage_lag": voltage_lag,
        "temperature": temperature,
    }
    numbers = {name: _checked(name, value) for name, value in given.items() if value is not None}
    return _read_options(numbers, column, unit, current_sign, where, cycles, sheet, join)


def _checked(name: str, value: Any) -> float:
    """The number that was given for an option for reading."""
    check = as_celsius if name == "temperature" else as_number
    return check(value, _typed(name))


def _typed(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _read_options(
    numbers: Mapping[str, float],
    column: Mapping[str, str | int] | None,
    unit: Mapping[str, str] | None,
    current_sign: str,
    where: Mapping[str, Any] | None,
    cycles: str | int | None,
    sheet: str | None,
    join: bool,
) -> ReadOptions:
    """What a person says about files, its numbers checked already."""
    from .tasks.record_request import parse_cycles

    content: dict[str, Any] = {
        **{field: numbers[name] for field, name in FIELDS.items() if name in numbers},
        "columns": by_signal(column, "--column"),
        "units": by_signal(unit, "--unit"),
        "where": {key: str(value) for key, value in (where or {}).items()},
        "cycles": None if cycles is None else parse_cycles(str(cycles)),
        "current_sign": current_sign,
        "sheet": sheet,
        "join": join,
    }
    return validated(ReadOptions, content, "the options of the record")


def readings(
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    current_sign: str = "charge-positive",
    constant_current: Numbers = None,
    current_offset: Numbers = None,
    voltage_lag: Numbers = None,
    where: Mapping[str, Any] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    temperature: Numbers = None,
    join: bool = False,
) -> list[ReadOptions]:
    """What a person says about files as `reading` takes it, once for all of them, or for each where a number differs.

    Raises `BsaError` if an option is not valid, or two have different numbers of values.
    """
    given = {
        "constant_current": constant_current,
        "current_offset": current_offset,
        "voltage_lag": voltage_lag,
        "temperature": temperature,
    }
    several = {name: [_checked(name, value) for value in as_several(values)] for name, values in given.items()}
    counts = {_typed(name): len(values) for name, values in several.items() if len(values) > 1}
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{option} {count} times" for option, count in counts.items())
        raise BsaError(f"{said} were given.", "give each once for all records, or once for each, in their order.")
    rows = [
        {name: values[min(n, len(values) - 1)] for name, values in several.items() if values}
        for n in range(max([1, *counts.values()]))
    ]
    return [_read_options(row, column, unit, current_sign, where, cycles, sheet, join) for row in rows]


def one_each(reads: Sequence[ReadOptions], count: int) -> list[ReadOptions]:
    """What is said of each of so many records. Raises `BsaError` if it was said of another number of them."""
    if len(reads) not in (1, count):
        raise BsaError(
            f"an option for reading was given {len(reads)} times for {count} record{'s' * (count != 1)}.",
            "give it once for all records, or once for each, in their order, held-out ones last.",
        )
    return list(reads) * (count if len(reads) == 1 else 1)


def numbered_folder(parent: Path, name: str) -> Path:
    """A folder that does not exist yet: ``name-1``, ``name-2``, ..."""
    safe = "".join(character if character.isalnum() or character in "-_." else "-" for character in name)
    number = 1
    while (parent / f"{safe}-{number}").exists():
        number += 1
    return parent / f"{safe}-{number}"


@dataclass(frozen=True)
class Records:
    """Records to be matched or predicted, and how the files among them are read."""

    sources: Sequence[Path | Record]
    held_out: Sequence[Path | Record] = ()  # Are not fitted, and scored after the search.
    # What headers do not say: once for all, or for each of them, held-out ones last.
    reads: Sequence[ReadOptions] = (ReadOptions(),)
    reader: str | None = None  # The reader to use; None finds the one that fits.
    reader_options: Mapping[str, Any] = field(default_factory=dict)  # The reader's own options.
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
        return self.reads[0].join and files and len(self.sources) > 1

    def each_read(self) -> list[ReadOptions]:
        """What headers do not say, for each source and each record that is held out.

        Raises `BsaError` if that was said for another number of records.
        """
        return one_each(self.reads, (1 if self.joined else len(self.sources)) + len(self.held_out))

    def requests(self) -> list[RecordRequest]:
        """What is asked of each source; files of one cell are joined.

        Raises `BsaError` if there are several states of charge, but not one for each record, or one is not between 0
        and 1.
        """
        from .tasks.record_request import RECOGNISED

        sources = self._joined()
        wild = [soc for soc in self.initial_soc if not 0 <= soc <= 1]
        if wild:
            raise BsaError(f"an initial state of charge is {wild[0]:g}.", "give a share between 0 and 1.")
        if len(self.initial_soc) not in (0, 1, len(sources)):
            raise BsaError(
                f"{len(self.initial_soc)} initial states of charge were given for {len(sources)} records.",
                "give one for all records, or one for each, in their order.",
            )
        each = len(self.initial_soc) == len(sources)
        socs = self.initial_soc if each else [*self.initial_soc, None][:1] * len(sources)
        protocol = RECOGNISED if self.as_protocol else None
        asked = self._asked(sources, self.each_read()[: len(sources)], socs, protocol=protocol)
        return [request.as_life(self.fit_cycles) for request in asked] if self.lives else asked

    def held_out_requests(self) -> list[RecordRequest]:
        """What is asked of each record that is held out."""
        count = len(self.held_out)
        return self._asked(self.held_out, self.each_read()[-count:] if count else [], [None] * count)

    def _asked(
        self,
        sources: Sequence[Path | Record],
        reads: Sequence[ReadOptions],
        socs: Sequence[float | None],
        **more: Any,
    ) -> list[RecordRequest]:
        from .tasks.record_request import RecordRequest

        return [
            RecordRequest(source, read, self.reader, self.reader_options, initial_soc=soc, **more)
            for source, read, soc in zip(sources, reads, socs, strict=True)
        ]

    def _joined(self) -> Sequence[Path | Record]:
        if not self.joined:
            return self.sources
        from .tasks.record_request import source_of

        files = [source for source in self.sources if isinstance(source, Path)]
        return [source_of(files, self.each_read()[0], self.reader, self.reader_options)]


@dataclass(frozen=True)
class CellChoice:
    """Which model of which cell, and what of it is searched; None leaves the default, or what a run began with."""

    parameters: str | None = None  # A parameter set, a parameter file or the folder of a run.
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
    from .tasks.parameter_source import parameter_source, read_finished, start_from, with_its_space
    from .tasks.records import build_task

    requests = records.requests()
    asked: dict[str, Any] = {
        "name": named_after([request.source for request in requests]),
        "records": requests,
        "held_out": records.held_out_requests(),
        "scale_to_capacity": cell.scale,
        "ocp": cell.ocp,
        "search": cell.search or ("life" if records.lives else "cell"),
    }
    if cell.start_from is not None:
        if cell.parameters is not None:
            raise BsaError(
                f'both a run to start from and the parameter set "{cell.parameters}" were given.', "give one of them."
            )
        run = read_finished(cell.start_from)
        base, overrides = start_from(run, cell.search)
        begun = run.task.cell
        model, options = cell.model or begun.model, {**begun.options, **cell.options}
        effects = cell.effects or begun.effects
        task = build_task(
            parameter_set=base, overrides=overrides, model=model, options=options, effects=effects, **asked
        )
        return task if cell.search is not None else with_its_space(task, run, bool(records.initial_soc))
    if cell.parameters is None:
        raise BsaError(
            "a record needs a parameter set to start from.",
            "add --parameters Chen2020 (NMC811), Marquis2019 or Ai2020 (LCO), Prada2013 (LFP), Ecker2015 (NMC), or "
            "nearest with a discharge at C/10; bsa list parameters shows all sets.",
        )
    source = parameter_source(cell.parameters)
    model = cell.model or "DFN"
    return build_task(parameter_set=source, model=model, options=cell.options, effects=cell.effects, **asked)


def run_request(
    named: Task | None,
    records: Records,
    cell: CellChoice,
    configured: Callable[[str], RunConfig],
    weight: str | None,
    out: Path | None,
) -> RunRequest:
    """What a run is asked: a task that was named, with the records that it is to hold out, or that of matching records.

    ``configured`` gives the configuration for a simulator (`run_config`). ``weight`` is how errors count; None leaves
    it to the task. ``out`` is None for a new folder under ``runs``. Raises `BsaError` if any of it makes no sense.
    """
    from .tasks.records import holding_out

    if named is not None:
        _check_of_task(named, records, cell)
    config = configured("" if named is None else named.simulator)
    task = task_of_records(records, cell) if named is None else holding_out(named, records.held_out_requests())
    if weight is not None:
        task = replace(task, weight=cast("Weight", weight))
    return RunRequest(task, config, out or numbered_folder(Path("runs"), f"{task.name}-{config.scaffold.name}"))


def _check_of_task(named: Task, records: Records, cell: CellChoice) -> None:
    """Refuse what goes with records where a task was named, which says it itself."""
    said = {
        "--parameters": cell.parameters is not None,
        "--start-from": cell.start_from is not None,
        "--model": cell.model is not None,
        "--options": bool(cell.options),
        "--search": cell.search is not None,
        "--effect": bool(cell.effects),
        "--ocp": bool(cell.ocp),
        "--no-scale": not cell.scale,
        "--initial-soc": bool(records.initial_soc),
        "--as-protocol": records.as_protocol,
        "--life": records.life,
        "--fit-cycles": records.fit_cycles is not None,
        "options for reading": not records.held_out and list(records.reads) != [ReadOptions()],
    }
    given = [name for name, is_given in said.items() if is_given]
    if given:
        verb = "goes" if len(given) == 1 and given[0].startswith("-") else "go"
        raise BsaError(
            f'{", ".join(given)} {verb} with records, but "{named.name}" is a task, which has its own.',
            "give records as data, or leave that out; a task file says it under keys of its own.",
        )


def named_after(sources: Sequence[Path | Record | ImpedanceSpectrum]) -> str:
    """The first record's name, and how many more there are."""
    first = sources[0]
    name = Path(first.name if isinstance(first, Record | ImpedanceSpectrum) else first).stem[:60]
    return name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")


def simulation_workers(asked: int) -> int:
    """How many simulations run side by side: what was asked for, or one on each of up to four cores.

    Raises `BsaError` if it is no number of simulations.
    """
    if isinstance(asked, bool) or not isinstance(asked, Integral) or asked < 0:
        raise BsaError(
            f"--workers is {shown(repr(asked))}, which is no number of simulations.",
            "give how many run side by side; 0 takes as many as there are cores, 4 at most.",
        )
    return int(asked) or min(os.cpu_count() or 1, 4)


def backend_options(options: Mapping[str, Any], **given: Any) -> dict[str, Any]:
    """How a language model is reached and asked, as it goes into a configuration: only what was set."""
    said = {key: str(value) if isinstance(value, Path) else value for key, value in given.items() if value is not None}
    return dict(options) | said
