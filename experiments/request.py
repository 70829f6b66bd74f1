"""From what a person typed to what a run needs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pydantic import ValidationError

from ..core.errors import BsaError
from ..core.record import ReadOptions, Record
from ..core.run_config import RunConfig
from ..core.scaffold import Scaffold, load_scaffold
from ..core.task import Task, Weight
from ..core.validation import explain
from ..core.yaml_text import parse_yaml

if TYPE_CHECKING:
    from .tasks.records import RecordRequest


@dataclass(frozen=True)
class RunRequest:
    """A run that is about to start."""

    task: Task  # What is to be matched.
    config: RunConfig  # Scaffold, budgets, seed.
    folder: Path  # Where it goes.


@dataclass(frozen=True)
class Overrides:
    """What replaces the defaults of a run's configuration."""

    # rounds, warm_up, simulations, seed: As in `RunConfig`.
    rounds: int
    warm_up: int
    simulations: int
    seed: int
    # Any other key: a field of `RunConfig`, or a dotted path into the scaffold (``feedback.use``).
    settings: dict[str, Any] = field(default_factory=dict)

    def config(self, scaffold: str | Scaffold, backend: str, options: dict[str, Any], simulator: str = "") -> RunConfig:
        """The checked configuration.

        Parameters
        ----------
        scaffold, backend, options
            As they were typed; a scaffold may be given as it is, too.
        simulator : str
            The task's own, for a scaffold that names none.

        Raises
        ------
        BsaError
            Naming the key at fault and the nearest valid one.
        """
        chosen = load_scaffold(scaffold) if isinstance(scaffold, str) else scaffold
        content: dict[str, Any] = {
            "scaffold": chosen.made_for(simulator).model_dump(),
            "backend": backend,
            "backend_options": options,
            "rounds": self.rounds,
            "warm_up": self.warm_up,
            "simulations": self.simulations,
            "seed": self.seed,
        }
        for key, value in self.settings.items():
            path = key.split(".")
            # `warm_up` is a number of simulations, `warm_up.use` a part of the scaffold.
            if path[0] not in RunConfig.model_fields or (len(path) > 1 and not isinstance(content.get(path[0]), dict)):
                path = ["scaffold", *path]
            _put(content, path, value, key)
        try:
            return RunConfig.model_validate(content)
        except ValidationError as error:
            raise explain(error, "run configuration", RunConfig) from None


def _put(content: dict[str, Any], path: Sequence[str], value: Any, key: str) -> None:
    *parents, last = path
    place: Any = content
    for part in parents:
        if isinstance(place, dict) and part in place and place[part] is None:
            place[part] = {}  # a part of the scaffold that it leaves out
        place = place.get(part) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise BsaError(
                f'--set {key}: there is no setting "{key}".',
                f"settings of a run: {', '.join(RunConfig.model_fields)}; of its scaffold: simulator, feedback, "
                "memories, warm_up and proposer, each with .use and .options.",
            )
    place[last] = value


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


def read_options(
    columns: Mapping[str, str], units: Mapping[str, str], where: Mapping[str, str], cycles: str | None, **others: Any
) -> ReadOptions:
    """What a person says about a file. Raises `BsaError` if an option is not valid."""
    from .tasks.records import parse_cycles

    content: dict[str, Any] = {
        "columns": dict(columns),
        "units": dict(units),
        "where": dict(where),
        "cycles": None if cycles is None else parse_cycles(cycles),
        **others,
    }
    try:
        return ReadOptions.model_validate(content)
    except ValidationError as error:
        raise explain(error, "the options of the record", ReadOptions) from None


def numbered_folder(parent: Path, name: str) -> Path:
    """A folder that does not exist yet: ``name-1``, ``name-2``, ..."""
    safe = "".join(character if character.isalnum() or character in "-_." else "-" for character in name)
    number = 1
    while (parent / f"{safe}-{number}").exists():
        number += 1
    return parent / f"{safe}-{number}"


def task_of_records(
    sources: Sequence[Path | Record],
    read: ReadOptions,
    reader: str | None,
    reader_options: Mapping[str, Any],
    parameters: str | None,
    model: str | None,
    options: Mapping[str, Any],
    search: str | Mapping[str, Any] | None,
    scale: bool,
    holdout: Sequence[Path | Record] = (),
    initial_soc: Sequence[float] = (),
    start: Path | None = None,
    as_protocol: bool = False,
) -> Task:
    """The task of matching records, all read alike, those that are held out included.

    Parameters
    ----------
    start : Path, optional
        Folder of a run that this one begins from: its parameters, model, options and search stand where nothing else
        is said.
    as_protocol : bool
        Whether the steps that the records show are simulated, in place of the measured current.

    Raises
    ------
    BsaError
        If no parameter set is given, or a record, a set or a parameter makes no sense.
    """
    from .tasks.parameter_source import parameter_source, read_finished, start_from, with_its_space
    from .tasks.records import build_task

    files = [source for source in sources if isinstance(source, Path)]
    if read.join and len(files) == len(sources) > 1:
        from ..core.reading.reading import read_record

        sources = [read_record(files, read, reader=reader, reader_options=reader_options)]
    asked: dict[str, Any] = {
        "name": named_after(sources),
        "records": requests_of(sources, read, reader, reader_options, initial_soc, as_protocol),
        "held_out": requests_of(holdout, read, reader, reader_options),
        "scale_to_capacity": scale,
    }
    if start is not None:
        if parameters is not None:
            raise BsaError(
                f'both a run to start from and the parameter set "{parameters}" were given.', "give one of them."
            )
        run = read_finished(start)
        base, overrides = start_from(run, search)
        task = build_task(
            parameter_set=base,
            overrides=overrides,
            model=model or run.task.cell.model,
            options={**run.task.cell.options, **options},
            search=search or "cell",
            **asked,
        )
        return task if search is not None else with_its_space(task, run)
    if parameters is None:
        raise BsaError(
            "a record needs a parameter set to start from.",
            "add --parameters Chen2020 (NMC811), Marquis2019 or Ai2020 (LCO), Prada2013 (LFP), Ecker2015 (NMC); "
            "bsa list parameters shows all sets.",
        )
    return build_task(
        parameter_set=parameter_source(parameters),
        model=model or "DFN",
        options=options,
        search=search or "cell",
        **asked,
    )


def weighted(task: Task, weight: str | None) -> Task:
    """The task with the weight of errors that was asked for; its own where none was.

    Raises `BsaError` if there is no such weight.
    """
    return task if weight is None else replace(task, weight=cast("Weight", weight))


def requests_of(
    sources: Sequence[Path | Record],
    read: ReadOptions,
    reader: str | None,
    reader_options: Mapping[str, Any],
    initial_soc: Sequence[float] = (),
    as_protocol: bool = False,
) -> list[RecordRequest]:
    """What is asked of each record, all read alike.

    Parameters
    ----------
    sources, read, reader, reader_options
        As in `RecordRequest`.
    initial_soc : sequence of float
        Nothing, one state of charge for all records, or one for each.
    as_protocol : bool
        Whether the steps that the records show are simulated, in place of the measured current.

    Raises
    ------
    BsaError
        If there are several states of charge, but not one for each record, or one is not between 0 and 1.
    """
    wild = [soc for soc in initial_soc if not 0 <= soc <= 1]
    if wild:
        raise BsaError(f"an initial state of charge is {wild[0]:g}.", "give a share between 0 and 1.")
    if len(initial_soc) not in (0, 1, len(sources)):
        raise BsaError(
            f"{len(initial_soc)} initial states of charge were given for {len(sources)} records.",
            "give one for all records, or one for each, in their order.",
        )
    socs = list(initial_soc) if len(initial_soc) == len(sources) else [*initial_soc, None][:1] * len(sources)
    from .tasks.records import RECOGNISED, RecordRequest

    protocol = RECOGNISED if as_protocol else None
    return [
        RecordRequest(source, read, reader, reader_options, protocol, initial_soc=soc)
        for source, soc in zip(sources, socs, strict=True)
    ]


def named_after(sources: Sequence[Path | Record]) -> str:
    """The first record's name, and how many more there are."""
    first = sources[0]
    name = Path(first.name if isinstance(first, Record) else first).stem[:60]
    return name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")


def simulation_workers(asked: int) -> int:
    """How many simulations run side by side: what was asked for, or one on each of up to four cores."""
    return asked or min(os.cpu_count() or 1, 4)


def backend_options(options: Mapping[str, Any], **given: Any) -> dict[str, Any]:
    """How a language model is reached and asked, as it goes into a configuration: only what was set."""
    said = {key: str(value) if isinstance(value, Path) else value for key, value in given.items() if value is not None}
    return dict(options) | said
