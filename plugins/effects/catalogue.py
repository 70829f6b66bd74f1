"""All built-in effects, as entries of the catalogue."""

from collections.abc import Iterator
from functools import partial

from ...core.effect import Effect
from ...core.hooks import Entry, NoOptions
from . import ageing, electrical, kinetics, measurement, thermal, thermodynamic, transport

EFFECTS: tuple[Effect, ...] = (
    *electrical.EFFECTS,
    *thermal.EFFECTS,
    *thermodynamic.EFFECTS,
    *transport.EFFECTS,
    *kinetics.EFFECTS,
    *ageing.EFFECTS,
    *measurement.EFFECTS,
)
"""Every effect and variant, in the order in which they are listed."""


def _give(effect: Effect, options: NoOptions) -> Effect:
    return effect


def entries() -> Iterator[Entry]:
    """One entry for each effect; a variant's entry is named ``NAME.VARIANT``."""
    for effect in EFFECTS:
        yield Entry(effect.entry_name, partial(_give, effect), f"{effect.title}: {effect.equation}", api=1)
