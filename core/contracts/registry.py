"""The catalogue: finds plugins, built-in and third-party alike, through the entry-point group ``bsa``."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distribution, distributions
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ..domain import Domain
from ..errors import BsaError, did_you_mean
from ..hooks import API_VERSION, PROJECT, CatalogueHooks, Entry
from ..printable import described, shown
from ..validation import validated
from .border import Unfit, border, in_words
from .hook_methods import call, hook_methods
from .kinds import HOOKS, Kind

_LISTED: dict[str, Kind] = {hook: kind for kind, hook in HOOKS.items()}
"""The kind that a hook lists."""

_NAMED_AMONG: dict[Kind, Kind] = {"route": "backend"}
"""Kinds that share the names of another: a route stands behind ``--backend`` as well, ``--backend ROUTE:MODEL``."""

OWN = "battery-sim-agent"
"""Our own distribution: a name that it uses stays its own."""

_FACTORY_ARGUMENTS = ("options", "context")
"""What a factory is given, as docs/plugins.md names it; those of backends, routes, readers and effects the first alone.
"""

_NAME = re.compile(r"[a-z0-9][a-z0-9.+-]*")


@dataclass(frozen=True)
class Listing:
    """An entry and where it comes from."""

    kind: Kind  # ``"simulator"``, ``"memory"``, ...
    entry: Entry  # What the plugin declared.
    origin: str  # Distribution and version, ``"battery-sim-agent 0.1.0"``.

    @property
    def who(self) -> str:
        """Kind, name, distribution and version, for messages: ``"memory notebook of my-plugin 0.1"``."""
        return f"{self.kind} {self.entry.name} of {self.origin}"

    @property
    def own(self) -> bool:
        """Whether it is built in."""
        return self.origin.startswith(f"{OWN} ")


@dataclass(frozen=True)
class Unusable:
    """What a distribution offers and nobody can use."""

    name: str  # Name of the entry, or of the entry point where the fault is not that of one entry.
    reason: str  # What is wrong, in one line.
    origin: str  # Distribution and version.
    kind: Kind | None = None  # Kind of the entry; None for a whole plugin, or one of its hooks.
    hook: Kind | None = None  # Kind that the hook at fault lists, where it is the fault of one hook.

    def concerns(self, kind: Kind) -> bool:
        """Whether it is a plugin of this kind, or could have been one: what a whole plugin offers is not known."""
        own = self.kind or self.hook
        return own is None or _is(own, kind)


class Registry:
    """Every entry that the installed distributions offer.

    A plugin that cannot be used is passed over and kept in `unusable` with its reason: it is an error where it is
    asked for by name, and nowhere else.
    """

    def __init__(self) -> None:
        self._plugins: list[tuple[object, str, str]] = []
        self._listings: dict[tuple[Kind, str], Listing] = {}
        self._not_loaded: list[Unusable] = []
        self._not_listed: list[Unusable] = []

    @property
    def unusable(self) -> list[Unusable]:
        """What is offered and cannot be used."""
        return [*self._not_loaded, *self._not_listed]

    def load_entry_points(self) -> Registry:
        """Register everything in the entry-point group ``bsa`` and collect the entries."""
        seen: set[str] = set()
        for found in distributions():
            try:
                if not _points_of(found):  # asked first: reading the metadata of all that is installed takes long
                    continue
                # The first distribution of a name on the path is the one that imports see.
                first = distribution(found.metadata["Name"])
                name, version, points = first.metadata["Name"], first.version, _points_of(first)
            except Exception:  # metadata that cannot be read: whose they are cannot be said either
                continue
            if _normalised(name) in seen:
                continue
            seen.add(_normalised(name))
            for point in points:
                self._load(point, f"{name} {version}")
        return self.collect()

    def _load(self, point: EntryPoint, origin: str) -> None:
        try:
            plugin = point.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever an installed plugin does when imported, SystemExit too
            self._not_loaded.append(Unusable(point.name, f"cannot be imported: {_reason(error)}", origin))
            return
        self.register(plugin, point.name, origin)

    def register(self, plugin: object, name: str, origin: str) -> None:
        """Add one catalogue plugin; entries appear after `collect`."""
        self._plugins.append((plugin, name, origin))

    def collect(self) -> Registry:
        """Ask the registered plugins for their entries, and settle who has a name that several offer."""
        self._not_listed.clear()
        offered: dict[tuple[Kind, str], list[Listing]] = {}
        for plugin, name, origin in self._plugins:
            for listing in self._listings_of(plugin, name, origin):
                among = _NAMED_AMONG.get(listing.kind, listing.kind)
                offered.setdefault((among, listing.entry.name), []).append(listing)
        self._listings = {}
        for key, rivals in offered.items():
            own = [listing for listing in rivals if listing.own]
            if len(rivals) == 1 or len(own) == 1:
                self._listings[key] = (own or rivals)[0]
            for listing in rivals:
                if self._listings.get(key) is not listing:
                    others = " and ".join(other.origin for other in rivals if other is not listing)
                    reason = "the name is taken by" if key in self._listings else "the name is also offered by"
                    self._not_listed.append(Unusable(key[1], f"{reason} {others}", listing.origin, listing.kind))
        return self

    def _listings_of(self, plugin: object, name: str, origin: str) -> Iterable[Listing]:
        """The entries of a plugin that can be used; the others are noted."""
        try:
            methods, faults = hook_methods(plugin, CatalogueHooks)
        except Exception as error:  # a stranger's object need not even bear being looked at
            methods, faults = {}, {"": _reason(error)}
        self._not_listed += [Unusable(name, fault, origin, hook=_LISTED.get(of)) for of, fault in faults.items()]
        for kind, hook in HOOKS.items():
            if hook not in methods:
                continue
            entries: list[Any] = []
            try:
                for entry in call(methods[hook], {}):
                    entries.append(entry)  # one by one: what came before an exception counts
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                self._not_listed.append(Unusable(name, f"{_reason(error)} in {hook}", origin, hook=kind))
            for entry in entries:
                fault = _fault(entry)
                if fault and isinstance(entry, Entry) and isinstance(entry.name, str):
                    self._not_listed.append(Unusable(shown(entry.name), fault, origin, kind))
                elif fault:
                    self._not_listed.append(Unusable(name, f"{fault} (in {hook})", origin, hook=kind))
                else:
                    yield Listing(kind, entry, origin)

    def listings(self, kind: Kind | None = None) -> list[Listing]:
        """The entries of a kind, or all of them, in order of registration; routes are backends as well."""
        return [listing for listing in self._listings.values() if kind is None or _is(listing.kind, kind)]

    def names(self, kind: Kind) -> list[str]:
        """The names of a kind."""
        return [listing.entry.name for listing in self.listings(kind)]

    def find(self, kind: Kind, name: str) -> Listing:
        """The entry of this kind and name, with its origin.

        Raises `BsaError` if there is none, with the nearest name, or if nobody can use it, with the reason and who
        offers it.
        """
        listing = self._listings.get((_NAMED_AMONG.get(kind, kind), name))
        if listing is not None and _is(listing.kind, kind):
            return listing
        at_fault = [item for item in self.unusable if item.kind and _is(item.kind, kind) and item.name == name]
        if at_fault:
            reasons = "; ".join(f"{item.origin}: {item.reason}" for item in at_fault)
            distributions = " or ".join(dict.fromkeys(item.origin.split()[0] for item in at_fault))
            raise BsaError(f'the {kind} "{name}" cannot be used ({reasons}).', f"update or uninstall {distributions}.")
        names = self.names(kind)
        nearest = did_you_mean(name, names)
        # What a plugin would offer that cannot even be imported is not known: it may be what is looked for.
        missing = [
            f"{item.origin} cannot be used ({item.reason})."
            for item in self.unusable
            if item.kind is None and item.concerns(kind)
        ]
        parts = [nearest, f"Available: {', '.join(sorted(names)) or 'none'}.", *missing]
        raise BsaError(f'there is no {kind} "{name}".', " ".join(part for part in parts if part))

    def configure(self, kind: Kind, name: str, options: Mapping[str, Any]) -> Any:
        """Check a plugin's options against its configuration type.

        Raises `BsaError` naming the plugin, the key and the nearest valid key.
        """
        listing = self.find(kind, name)
        with border(listing.who, "its options"):
            return validated(listing.entry.config_type, dict(options), f'{kind} "{name}"')

    def make(self, kind: Kind, name: str, options: Mapping[str, Any], *more: Any) -> Any:
        """What the factory of this kind and name makes of checked options and whatever else it takes.

        Raises `BsaError` if there is no such plugin, an option is wrong, or the factory fails.
        """
        listing, checked = self.find(kind, name), self.configure(kind, name, options)
        with border(listing.who, "its factory"):
            _check_call(listing.entry.factory, (checked, *more))
            return listing.entry.factory(checked, *more)


def _check_call(factory: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Whether a factory takes what it is given. Raises `Unfit` if not, with its place."""
    try:
        signature = inspect.signature(factory)
    except (TypeError, ValueError):  # of some builtins nothing is known
        return
    try:
        signature.bind(*arguments)
    except TypeError as error:
        names = ", ".join(_FACTORY_ARGUMENTS[: len(arguments)])
        raise Unfit(f"is called with ({names}), which it does not take: {error}", _place(factory)) from None


def _place(factory: Callable[..., Any]) -> str:
    """Where a factory stands, as a hint."""
    try:
        file, (_, line) = inspect.getsourcefile(factory), inspect.getsourcelines(factory)
    except (TypeError, OSError):
        return ""
    return f"change {factory.__qualname__} at {Path(file or '').name}, line {line}."


def _is(kind: Kind, asked: Kind) -> bool:
    return asked in (kind, _NAMED_AMONG.get(kind))


def _fault(entry: Any) -> str:
    """Why an entry cannot be used; empty if it can."""
    if not isinstance(entry, Entry):
        return f"it lists {described(entry)}: yield bsa.core.hooks.Entry objects"
    if not isinstance(entry.name, str) or not _NAME.fullmatch(entry.name):
        return f"the name {shown(repr(entry.name))}: use lower-case letters, digits, hyphens, dots and plus"
    if not isinstance(entry.api, int) or entry.api != API_VERSION:
        return f"it was written for plugin interface {shown(repr(entry.api))}, but this is interface {API_VERSION}"
    if not callable(entry.factory):
        return f"its factory {described(entry.factory)} cannot be called"
    if not isinstance(entry.summary, str):
        return f"its summary {described(entry.summary)} is no text"
    if not isinstance(entry.config_type, type) or not issubclass(entry.config_type, BaseModel):
        return f"its config_type {described(entry.config_type)} is no pydantic model"
    if entry.domain is not None and not isinstance(entry.domain, Domain):
        return f"its domain {described(entry.domain)} is no bsa.core.domain.Domain"
    return ""


def _reason(error: BaseException) -> str:
    words, kind = in_words(error), type(error).__name__
    return words if words == kind else f"{kind}: {words}"


def _points_of(found: Distribution) -> list[EntryPoint]:
    return [point for point in found.entry_points if point.group == PROJECT]


def _normalised(name: str) -> str:
    """A distribution's name as installers compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


@cache
def installed() -> Registry:
    """The registry of everything installed here; read once per process."""
    return Registry().load_entry_points()
