"""A grid as a person writes it: a short YAML file whose axes are multiplied."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, NonNegativeInt, field_validator

from ...core.errors import BsaError, unknown
from ...core.printable import shown
from ...core.scaffold import PluginChoice, Scaffold
from ...core.validation import validated
from ...core.yaml_text import YAML_SUFFIXES, read_yaml
from ..suite.selection import Suite
from .cell import Axis

SHIPPED = Path(__file__).parent.parent / "grids"


class SuiteFilter(BaseModel, extra="forbid"):
    """A part of a benchmark suite."""

    suite: Suite = Field(description="Which suite.")
    mode: str | None = Field(None, description="Only cases of this mode: regular, extreme, sei.")
    chemistry: str | list[str] | None = Field(None, description="Only cases on these parameter sets.")
    rates: str | list[str] | None = Field(None, description='Only these rates, charge/discharge: "1C/2C".')
    cases: int | str | list[str] | None = Field(
        None, description="How many of them (drawn evenly), or keys and patterns; all if left out."
    )
    draw: int = Field(0, ge=0, description="Which of them a number takes; for the random suite and lives, its seed.")
    search: str | None = Field(None, description="Search-space preset; the case's own if left out.")
    starts: list[NonNegativeInt] = Field(
        default_factory=lambda: [0],
        min_length=1,
        description="Where searches start, each a task of its own: 0 is the base cell; 1, 2, ... are drawn by "
        "number, in the middle half of every range.",
    )
    noise_mv: float = Field(0.0, ge=0, description="Noise put on the voltage of the targets, mV.")
    folder: Path | None = Field(None, description="Where the published files are, if not beside the repository.")

    @field_validator("cases")
    @classmethod
    def _number(cls, cases: int | str | list[str] | None) -> int | str | list[str] | None:
        return int(cases) if isinstance(cases, str) and cases.strip().isdecimal() else cases


class BackendChoice(PluginChoice):
    """A language model and how it may be used; in a file either its name alone or a mapping."""

    at_once: int | None = Field(
        None, ge=1, description="Calls at a time over all cells and processes that share the store; no limit if unset."
    )
    usd_per_million_tokens: float | None = Field(
        None, ge=0, description="Price for the estimate of --dry-run, where no finished cell tells it."
    )


TaskChoice = str | SuiteFilter

_KEYS_OF_THEIR_OWN = {
    "seed": "seeds",
    "backend": "backends",
    "backend_options": "the options of an entry of backends",
    "scaffold": "scaffolds",
    "rounds": "rounds",
    "warm_up": "warm_up",
    "simulations": "simulations",
}
"""Settings of a run for which a grid has a key: as `settings` they would be ignored, or differ from what tables say."""


class Budgets(BaseModel, extra="forbid"):
    """How much a run may spend; what is left out keeps the default of `RunConfig`."""

    rounds: int | None = Field(None, ge=0, description="Rounds of the search at most.")
    warm_up: int | None = Field(None, ge=0, description="Warm-up simulations at most.")
    simulations: int | None = Field(None, ge=1, description="Simulations at most, in all.")
    settings: dict[str, Any] = Field(
        default_factory=dict,
        description="Any other setting, as --set of bsa run: feedback.use: overlay. A patience left out is `rounds`: "
        "methods that are compared get their whole budget.",
    )

    @field_validator("settings")
    @classmethod
    def _without_keys_of_a_grid(cls, settings: dict[str, Any]) -> dict[str, Any]:
        for key in settings:
            name = "backend_options" if key.startswith("backend_options.") else key
            if name in _KEYS_OF_THEIR_OWN:
                raise ValueError(f'"{key}" is set outside of settings: write {_KEYS_OF_THEIR_OWN[name]}')
        return settings


class Included(Budgets):
    """More cells: the grid again with some axes or budgets replaced."""

    tasks: list[TaskChoice] | None = Field(None, min_length=1, description="Instead of the grid's tasks.")
    backends: list[BackendChoice] | None = Field(None, min_length=1, description="Instead of the grid's backends.")
    scaffolds: list[str | Scaffold] | None = Field(None, min_length=1, description="Instead of the grid's scaffolds.")
    seeds: list[NonNegativeInt] | None = Field(None, min_length=1, description="Instead of the grid's seeds.")


class GridFile(Budgets):
    """A grid: tasks x scaffolds x backends x seeds, plus `include`, minus `exclude`."""

    name: str = Field(min_length=1, max_length=60, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", description="Short name.")
    summary: str = Field("", description="What the grid is to show, in one line.")
    tasks: list[TaskChoice] = Field(
        min_length=1, description="Packaged tasks, task files, encoded tasks (.json) or filters of a suite."
    )
    scaffolds: list[str | Scaffold] = Field(min_length=1, description="Scaffolds by name, files, or written out.")
    backends: list[BackendChoice] = Field(
        default_factory=lambda: [BackendChoice(use="rules")], min_length=1, description="Language models."
    )
    seeds: list[NonNegativeInt] = Field(default_factory=lambda: [1234], min_length=1, description="Seeds.")
    include: list[Included] = Field(default_factory=list, description="More cells.")
    exclude: list[dict[Axis, Any]] = Field(
        default_factory=list, description="Cells to leave out: those that fit every key, by value, list or pattern."
    )
    reference: str | None = Field(None, description="The method that others are compared with; the first if unset.")
    paper_rows: bool = Field(False, description="Whether tables quote the paper's own rows.")


def load_grid(name_or_path: str, changes: Mapping[str, Any] | None = None) -> GridFile:
    """A shipped grid by name, or one from a YAML file.

    ``changes`` replace values of the file by dotted path: ``{"rounds": 5, "tasks.0.cases": 2}``. Raises `BsaError` if
    there is no such grid, or it is not a valid one, with the key at fault.
    """
    path = grid_path(name_or_path)
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise BsaError(f"{path} is not a grid.", "write keys and values: name, tasks, scaffolds, backends, seeds.")
    for key, value in (changes or {}).items():
        _put(content, key, value)
    return validated(GridFile, content, str(path))


def grid_path(name_or_path: str) -> Path:
    """Where a grid's file lies. Raises `BsaError` if no shipped grid has this name."""
    path = Path(name_or_path)
    if path.suffix in YAML_SUFFIXES:
        return path
    names = shipped_names()
    if name_or_path not in names:
        listed = "shipped: {}; or give the path of a .yaml file."
        raise unknown(f'there is no grid "{name_or_path}".', name_or_path, names, listed)
    return SHIPPED / f"{name_or_path}.yaml"


def shipped_names() -> list[str]:
    """The grids that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def _put(content: dict[str, Any], key: str, value: Any) -> None:
    first, *rest = key.split(".")
    # Settings of a run are dotted paths themselves.
    path: Sequence[str] = [first, ".".join(rest)] if first == "settings" and rest else [first, *rest]
    if first not in GridFile.model_fields:
        raise unknown(f'--set {key}: a grid has no key "{first}".', first, GridFile.model_fields, "keys: {}.")
    place: Any = content
    for depth, (part, following) in enumerate(pairwise(path), start=1):
        if isinstance(place, list):
            place = _item(place, part, key)
        else:
            place = place.setdefault(part, {} if not following.isdigit() else [])
        if not isinstance(place, (dict, list)):
            whole = ".".join(path[:depth])
            raise BsaError(
                f"--set {shown(key)}: {shown(whole)} is {shown(repr(place))}, a single value without parts.",
                f"replace it as a whole: --set {shown(whole)}=VALUE.",
            )
    if isinstance(place, list):
        _item(place, path[-1], key)
        place[int(path[-1])] = value
    else:
        place[path[-1]] = value


def _item(items: list[Any], part: str, key: str) -> Any:
    if not part.isdigit() or int(part) >= len(items):
        raise BsaError(f'--set {key}: "{part}" is not a place in a list of {len(items)}.', "count from 0.")
    return items[int(part)]
