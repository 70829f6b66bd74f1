"""From what a person typed to what a run needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..core.errors import BsaError
from ..core.record import ReadOptions
from ..core.run_config import RunConfig
from ..core.scaffold import load_scaffold
from ..core.task import Task
from ..core.validation import explain
from ..core.yaml_text import parse_yaml


@dataclass(frozen=True)
class RunRequest:
    """A run that is about to start.

    Attributes
    ----------
    task : Task
        What is to be matched.
    config : RunConfig
        Scaffold, budgets, seed.
    folder : Path
        Where it goes.
    """

    task: Task
    config: RunConfig
    folder: Path


@dataclass(frozen=True)
class Overrides:
    """What replaces the defaults of a run's configuration.

    Attributes
    ----------
    rounds, warm_up, simulations, seed : int
        As in `RunConfig`.
    settings : dict
        Any other key: a field of `RunConfig`, or a dotted path into the scaffold (``feedback.use``).
    """

    rounds: int
    warm_up: int
    simulations: int
    seed: int
    settings: dict[str, Any] = field(default_factory=dict)

    def config(self, scaffold: str, backend: str, options: dict[str, Any], simulator: str = "") -> RunConfig:
        """The checked configuration.

        Parameters
        ----------
        scaffold, backend, options
            As they were typed.
        simulator : str
            The task's own, for a scaffold that names none.

        Raises
        ------
        BsaError
            Naming the key at fault and the nearest valid one.
        """
        content: dict[str, Any] = {
            "scaffold": load_scaffold(scaffold).made_for(simulator).model_dump(),
            "backend": backend,
            "backend_options": options,
            "rounds": self.rounds,
            "warm_up": self.warm_up,
            "simulations": self.simulations,
            "seed": self.seed,
        }
        for key, value in self.settings.items():
            path = key.split(".")
            if path[0] not in RunConfig.model_fields:
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
        place = place.get(part) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise BsaError(
                f'--set {key}: there is no setting "{key}".',
                f"settings of a run: {', '.join(RunConfig.model_fields)}; of its scaffold: simulator, feedback, "
                "memories, warm_up and proposer, each with .use and .options.",
            )
    place[last] = value


def key_texts(pairs: Sequence[str] | None, option: str) -> dict[str, str]:
    """``["a=010", "b=x"]`` as a mapping of texts.

    Raises
    ------
    BsaError
        If a pair has no ``=``.
    """
    result: dict[str, str] = {}
    for pair in pairs or ():
        key, sign, value = (part.strip() for part in pair.partition("="))
        if not sign or not key:
            raise BsaError(f'{option} "{pair}" is not key=value.', f'write {option} "key=value".')
        result[key] = value
    return result


def key_values(pairs: Sequence[str] | None, option: str) -> dict[str, Any]:
    """``["a=1", "b=x"]`` as a mapping; values are read as YAML, and stay text where they are none.

    Raises
    ------
    BsaError
        If a pair has no ``=``.
    """
    result: dict[str, Any] = {}
    for key, text in key_texts(pairs, option).items():
        try:
            result[key] = parse_yaml(text, option)
        except BsaError:
            result[key] = text
    return result


def read_options(
    columns: dict[str, str], units: dict[str, str], where: dict[str, str], cycles: str | None, **others: Any
) -> ReadOptions:
    """What the command line says about a file.

    Raises
    ------
    BsaError
        If an option is not valid.
    """
    from .tasks.records import parse_cycles

    content: dict[str, Any] = {
        "columns": columns,
        "units": units,
        "where": where,
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
