"""What makes two cells the same: everything that determines a result, and nothing that does not."""

from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...core.contracts.effect_choice import entry_name
from ...core.contracts.registry import installed
from ...core.hooks import PROJECT
from ...core.run.run_config import RunConfig
from ..run import versions
from ..source_digest import package_digest, source_digest

PLACEMENT = frozenset({"base_url", "timeout_s", "retry_limit_s", "exchange"})
"""Options of a backend that say where and how patiently it is asked, not what it answers."""


def without_placement(options: dict[str, Any]) -> dict[str, Any]:
    """The options of a backend that determine its answers: a server that moved is still the same model."""
    return {key: value for key, value in options.items() if key not in PLACEMENT}


def identity_of(config: RunConfig, task_digest: str, effects: Sequence[str] = ()) -> str:
    """A cell's identity, 16 hex digits.

    The configuration is without placement; the hash of the encoded task stands for the task, which may be 100 kB long.
    ``effects`` are those of the task's cell; those that the scaffold offers take part too.
    """
    effects = (*effects, *config.scaffold.offers)
    taking_part = (*_plugins(config), *(("effect", entry_name(name)) for name in effects))
    return config.identity({"digest": task_digest}, dict(versions_of(taking_part)))


def all_effects() -> tuple[tuple[str, str], ...]:
    """The installed effects, as plugins that take part in a discovery."""
    return tuple((listing.kind, listing.entry.name) for listing in installed().listings("effect"))


@cache
def versions_of(plugins: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """What is installed, the code itself included, and who offers the plugins that take part, with a hash of theirs."""
    found = {**versions(), "code": code_digest()}
    for listing in installed().listings():
        kind, name = listing.kind, listing.entry.name
        if (kind, name) in plugins and not listing.own:
            found[f"{kind} {name}"] = f"{listing.origin} {plugin_digest(listing.origin.rpartition(' ')[0])}"
    return tuple(sorted(found.items()))


def versions_of_study(plugins: tuple[tuple[str, str], ...] = ()) -> tuple[tuple[str, str], ...]:
    """The same for what is no calibration: a task of a suite, an item of a study, a discovery."""
    return (*versions_of(plugins), ("experiments", study_digest()))


def code_digest() -> str:
    """A hash of the sources that decide what a run finds, beside its task, of which its identity has the content."""
    return package_digest("core", "plugins", "backends")


def study_digest() -> str:
    """A hash of the sources that decide further how tasks are made, what a study does, and how discoveries run."""
    places = ("tasks", "suite", "studies", "discovery_bench", "*.py")
    return package_digest(*(f"experiments/{place}" for place in places))


@cache
def plugin_digest(distribution_name: str) -> str:
    """The same of another distribution's modules: those that its plugins are in, and all that it declares.

    Empty where they cannot be found, as in a zip archive; the version of the distribution then has to do.
    """
    return source_digest(path for module in _modules(distribution_name) for path in _places(module))


def _modules(distribution_name: str) -> list[str]:
    """Top-level modules and packages of a distribution."""
    try:
        found = distribution(distribution_name)
    except PackageNotFoundError:
        return []
    offering = [point.module for point in found.entry_points if point.group == PROJECT]
    declared = (found.read_text("top_level.txt") or "").split()
    return sorted({name.partition(".")[0] for name in (*offering, *declared)})


def _places(module: str) -> list[Path]:
    """The file of a module, or the folders of a package."""
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        return []
    if spec is None:
        return []
    if spec.submodule_search_locations is not None:
        return [Path(place) for place in spec.submodule_search_locations]
    return [Path(spec.origin)] if spec.has_location and spec.origin else []


def _plugins(config: RunConfig) -> tuple[tuple[str, str], ...]:
    backend = config.backend.partition(":")[0]
    route = str(config.backend_options.get("via") or backend)
    chosen = ((kind, choice.use) for kind, choice in config.scaffold.parts)
    return (*chosen, ("backend", backend), ("route", route))
