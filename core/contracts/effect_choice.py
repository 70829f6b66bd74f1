"""The effects of the catalogue that were named, or all of them, made with their options."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..effect import Effect, Evidence
from ..errors import BsaError, did_you_mean, unknown
from . import products
from .border import border
from .registry import Listing, Registry, installed


def effects_of(
    names: Sequence[str] | None,
    registry: Registry | None = None,
    options: Mapping[str, Any] | None = None,
    note: Callable[[str], None] = lambda text: None,
) -> tuple[Effect, ...]:
    """The catalogue's effects, or those of the given names (variants included).

    ``names`` is None for all but those that are considered on request; ``registry`` by default that of what is
    installed. ``options`` are those of effects: ``"EFFECT.KEY"`` for one effect, ``"KEY"`` for all that have it.
    ``note`` is told of an effect that was passed over because it cannot be used and nobody named it. Raises `BsaError`
    if a name or an option is unknown, or an effect that was named cannot be used.
    """
    registry = registry or installed()
    listings = registry.listings("effect")
    own_options = _by_entry(listings, options or {})
    made: dict[str, Effect] = {}
    for listing in listings:
        entry = listing.entry.name
        try:
            effect = _made(registry, listing, own_options[entry])
        except BsaError as error:
            if own_options[entry] or any(entry_name(name) in (entry, entry.partition(".")[0]) for name in names or ()):
                raise
            note(f"passed over: {error}")
            continue
        if effect.key in made:
            note(f"passed over: {listing.who} has the key of another effect, {effect.key}.")
        else:
            made[effect.key] = effect
    if names is None:
        return tuple(effect for effect in made.values() if not effect.on_request)
    for name in names:
        if not any(effect.is_called(name) for effect in made.values()):
            if any((item.kind, item.name) == ("effect", entry_name(name)) for item in registry.unusable):
                registry.find("effect", entry_name(name))
            known = {called for effect in made.values() for called in (effect.name, effect.key)}
            raise unknown(f'there is no effect "{name}".', name, known, "bsa list effects shows them.")
    return tuple(effect for effect in made.values() if any(effect.is_called(name) for name in names))


def entry_name(name: str) -> str:
    """``"lithium-plating (reaction-limited)"`` as its entry is called, ``"lithium-plating.reaction-limited"``."""
    base, _, variant = name.removesuffix(")").partition(" (")
    return f"{base}.{variant.replace(' ', '-')}" if variant else base


def _made(registry: Registry, listing: Listing, options: Mapping[str, Any]) -> Effect:
    made = registry.make("effect", listing.entry.name, options)
    with border(listing.who, "its factory"):
        effect = products.effect(made, listing.entry.name)
    lacks = effect.lacks
    if lacks is None:
        return effect

    def asked(evidence: Evidence) -> str:
        """What the effect says, or why it could not be asked: it then counts as one that the records cannot show."""
        try:
            with border(listing.who, "lacks"):
                return products.instance(lacks(evidence), str)
        except BsaError as error:
            return error.message

    return replace(effect, lacks=asked)


def _by_entry(listings: Sequence[Listing], options: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The options of each effect, by its entry's name."""
    found: dict[str, dict[str, Any]] = {listing.entry.name: {} for listing in listings}
    for key, value in options.items():
        effect, _, option = key.rpartition(".")
        meant = [
            listing.entry
            for listing in listings
            if (effect in (listing.entry.name, listing.entry.name.partition(".")[0]))
            or (not effect and option in listing.entry.config_type.model_fields)
        ]
        if not meant and effect:
            nearest = did_you_mean(effect, found)
            raise BsaError(f'there is no effect "{effect}" to take the option "{key}".', nearest)
        if not meant:
            known = {name for listing in listings for name in listing.entry.config_type.model_fields}
            hint = "options: {}." if known else "leave it out."
            raise unknown(f'no effect has an option "{option}".', option, sorted(known), hint)
        for entry in meant:
            found[entry.name][option] = value
    return found
