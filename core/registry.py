"""The catalogue: finds plugins, built-in and third-party alike, through the entry-point group ``bsa``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, distributions
from typing import Any, Literal

import pluggy
from pydantic import ValidationError

from .errors import BsaError, did_you_mean
from .hooks import API_VERSION, PROJECT, CatalogueHooks, Entry
from .validation import explain

Kind = Literal["simulator", "feedback", "memory", "proposer", "warm-up", "backend", "reader", "effect"]

_HOOKS: dict[Kind, str] = {
    "simulator": "bsa_simulators",
    "feedback": "bsa_feedback_builders",
    "memory": "bsa_memories",
    "proposer": "bsa_proposers",
    "warm-up": "bsa_warm_ups",
    "backend": "bsa_backends",
    "reader": "bsa_readers",
    "effect": "bsa_effects",
}
KINDS: tuple[Kind, ...] = tuple(_HOOKS)

_NAME = re.compile(r"[a-z0-9][a-z0-9.+-]*")


@dataclass(frozen=True)
class Listing:
    """An entry and where it comes from.

    Attributes
    ----------
    kind : str
        ``"simulator"``, ``"memory"``, ...
    entry : Entry
        What the plugin declared.
    origin : str
        Distribution and version, ``"battery-sim-agent 0.1.0"``.
    """

    kind: Kind
    entry: Entry
    origin: str


def _origin(distribution: Distribution) -> str:
    return f"{distribution.metadata['Name']} {distribution.version}"


class Registry:
    """Every entry that the installed distributions offer.

    Raises
    ------
    BsaError
        If two distributions claim one plugin name or offer two entries of one kind and name, if a
        plugin cannot be imported, or if it implements a hook that does not exist.
    """

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(PROJECT)
        self._manager.add_hookspecs(CatalogueHooks)
        self._origins: dict[str, str] = {}
        self._listings: dict[tuple[Kind, str], Listing] = {}

    def load_entry_points(self) -> Registry:
        """Register everything in the entry-point group ``bsa`` and collect the entries."""
        seen_distributions: set[str] = set()
        for distribution in distributions():
            name = distribution.metadata["Name"]
            # The first distribution of a name on the path is the one that imports see.
            if name is None or name in seen_distributions:
                continue
            seen_distributions.add(name)
            for point in distribution.entry_points:
                if point.group == PROJECT:
                    self._load(point, _origin(distribution))
        return self.collect()

    def _load(self, point: Any, origin: str) -> None:
        try:
            plugin = point.load()
        except Exception as error:
            raise BsaError(
                f'plugin "{point.name}" of {origin} cannot be imported: {type(error).__name__}: {error}.',
                f"repair or uninstall {origin.split()[0]}.",
            ) from error
        self.register(plugin, point.name, origin)

    def register(self, plugin: object, name: str, origin: str) -> None:
        """Add one catalogue plugin; entries appear after `collect`."""
        if name in self._origins:
            raise BsaError(
                f'two distributions offer a plugin named "{name}": {self._origins[name]} and {origin}.',
                "uninstall one of them, or ask its author to rename the entry point.",
            )
        self._origins[name] = origin
        self._manager.register(plugin, name)

    def collect(self) -> Registry:
        """Check the registered plugins and list their entries."""
        try:
            self._manager.check_pending()
        except pluggy.PluginValidationError as error:
            raise BsaError(f"a plugin implements an unknown hook: {error}", "check the hook's name.") from error
        self._listings.clear()
        for kind, hook_name in _HOOKS.items():
            hook = getattr(self._manager.hook, hook_name)
            for implementation in hook.get_hookimpls():
                origin = self._origins[implementation.plugin_name]
                for entry in implementation.function():
                    self._add(kind, entry, origin)
        return self

    def _add(self, kind: Kind, entry: Entry, origin: str) -> None:
        if not isinstance(entry, Entry):
            raise BsaError(f"{origin} lists {entry!r} as a {kind}.", "yield bsa.core.hooks.Entry objects.")
        if not _NAME.fullmatch(entry.name):
            raise BsaError(
                f'{origin} names a {kind} "{entry.name}".', "use lower-case letters, digits, hyphens, dots and plus."
            )
        if entry.api != API_VERSION:
            raise BsaError(
                f'{kind} "{entry.name}" of {origin} was written for plugin interface {entry.api}, '
                f"but this is interface {API_VERSION}.",
                f"install a version of {origin.split()[0]} made for interface {API_VERSION}.",
            )
        other = self._listings.get((kind, entry.name))
        if other is not None:
            raise BsaError(
                f'two plugins offer a {kind} named "{entry.name}": {other.origin} and {origin}.',
                "uninstall one of them, or rename its entry.",
            )
        self._listings[kind, entry.name] = Listing(kind, entry, origin)

    def listings(self, kind: Kind | None = None) -> list[Listing]:
        """The entries of a kind, or all of them, in order of registration."""
        return [listing for listing in self._listings.values() if kind in (None, listing.kind)]

    def names(self, kind: Kind) -> list[str]:
        """The names of a kind."""
        return [listing.entry.name for listing in self.listings(kind)]

    def get(self, kind: Kind, name: str) -> Entry:
        """The entry of this kind and name.

        Raises
        ------
        BsaError
            If there is none, with the nearest name.
        """
        listing = self._listings.get((kind, name))
        if listing is None:
            names = self.names(kind)
            nearest = did_you_mean(name, names)
            raise BsaError(
                f'there is no {kind} "{name}".',
                f"{nearest} " * bool(nearest) + f"Available: {', '.join(sorted(names)) or 'none'}.",
            )
        return listing.entry

    def configure(self, kind: Kind, name: str, options: dict[str, Any]) -> Any:
        """Check a plugin's options against its configuration type.

        Raises
        ------
        BsaError
            Naming the plugin, the key and the nearest valid key.
        """
        entry = self.get(kind, name)
        try:
            return entry.config_type.model_validate(options)
        except ValidationError as error:
            raise explain(error, f'{kind} "{name}"', entry.config_type) from None


@cache
def installed() -> Registry:
    """The registry of everything installed here; read once per process."""
    return Registry().load_entry_points()
