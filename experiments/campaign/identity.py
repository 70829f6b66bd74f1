"""What makes two cells the same: everything that determines a result, and nothing that does not."""

import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...core.contracts.effect_choice import entry_name
from ...core.contracts.registry import Listing, installed
from ...core.hooks import PROJECT
from ...core.run.run_config import RunConfig
from ..run import versions

PLACEMENT = frozenset({"base_url", "timeout_s", "retry_limit_s", "exchange"})
"""Options of a backend that say where and how patiently it is asked, not what it answers."""

_ROOT = Path(__file__).parents[2]
_DECISIVE = ("core", "plugins", "backends")
_SOURCES = frozenset({".py", ".yaml", ".yml", ".json", ".toml"})
"""Suffixes of the files that determine what code does: the code, and the tables that it reads."""


def without_placement(options: dict[str, Any]) -> dict[str, Any]:
    """The options of a backend that determine its answers: a server that moved is still the same model."""
    return {key: value for key, value in options.items() if key not in PLACEMENT}


def identity_of(config: RunConfig, task_digest: str, effects: Sequence[str] = ()) -> str:
    """A cell's identity, 16 hex digits.

    The configuration is without placement; the hash of the encoded task stands for the task, which may be 100 kB long.
    ``effects`` are those of the task's cell.
    """
    taking_part = (*_plugins(config), *(("effect", entry_name(name)) for name in effects))
    return config.identity({"digest": task_digest}, dict(versions_of(taking_part)))


def all_effects() -> tuple[tuple[str, str], ...]:
    """The installed effects, as plugins that take part in a discovery."""
    return tuple((listing.kind, listing.entry.name) for listing in installed().listings("effect"))


@cache
def versions_of(plugins: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """What is installed, the code itself included, and who offers the plugins that take part, with a hash of theirs."""
    listings: dict[tuple[str, str], Listing] = {
        (listing.kind, listing.entry.name): listing for listing in installed().listings()
    }
    found = {**versions(), "code": code_digest()}
    for kind, name in plugins:
        listing = listings.get((kind, name))
        if listing is not None and not listing.own:
            found[f"{kind} {name}"] = f"{listing.origin} {plugin_digest(_distribution(listing))}"
    return tuple(sorted(found.items()))


@cache
def code_digest() -> str:
    """A hash of the sources that decide what a run finds: a version number alone does not change with every edit."""
    return _digest(_ROOT / room for room in _DECISIVE)


@cache
def plugin_digest(distribution_name: str) -> str:
    """The same of another distribution's modules: those that its plugins are in, and all that it declares.

    Empty where they cannot be found, as in a zip archive; the version of the distribution then has to do.
    """
    return _digest(path for module in _modules(distribution_name) for path in _places(module))


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


def _digest(places: Iterable[Path]) -> str:
    """A hash of the source files at these places, by their names below them; empty where there is none."""
    digest, any_found = hashlib.sha256(), False
    for place in places:
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.suffix in _SOURCES and path.is_file():
                any_found = True
                name = path.relative_to(place.parent).as_posix()
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16] if any_found else ""


def _distribution(listing: Listing) -> str:
    return listing.origin.rpartition(" ")[0]


def _plugins(config: RunConfig) -> tuple[tuple[str, str], ...]:
    backend = config.backend.partition(":")[0]
    route = str(config.backend_options.get("via") or backend)
    chosen = ((kind, choice.use) for kind, choice in config.scaffold.parts)
    return (*chosen, ("backend", backend), ("route", route))
