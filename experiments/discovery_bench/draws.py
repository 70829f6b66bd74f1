"""Draws a blind case from a seed: all of it, so that who writes the search cannot know what is hidden."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import pybamm

from .hidden_cell import Hidden
from .hidden_physics import EFFECTS, OUTSIDE, HiddenEffect
from .protocols import NAMES

Setting = Literal["single", "pair", "none", "outside"]

QUOTAS: dict[Setting, int] = {"single": 12, "none": 4, "pair": 2, "outside": 2}
"""Cases of each setting in every twenty."""

BLOCK = sum(QUOTAS.values())

DFN_SHARE = 0.25
"""Share of cases whose base model is a DFN; others have an SPMe where what is hidden allows it."""

NOISE_V, RESOLUTIONS_V = (2e-4, 2e-3), (1e-4, 5e-4, 1e-3)
"""Ends of the voltage noise's deviation, and steps of the readings: from a good cycler to a poor one."""

MESH_POINTS = (25, 41)
"""Least mesh points of the true cell, and one more than the most: finer than the 20 of a discovery's models."""

CHEMISTRIES = ("Chen2020", "Marquis2019", "Mohtat2020", "OKane2022")
"""Parameter sets with which every effect can be simulated."""

SPREADS = {
    "Negative electrode active material volume fraction": 0.04,
    "Positive electrode active material volume fraction": 0.04,
    "cyclable lithium": 0.01,
    "Negative particle radius [m]": 0.12,
    "Positive particle radius [m]": 0.12,
    "Negative particle diffusivity [m2.s-1]": 0.4,
    "Positive particle diffusivity [m2.s-1]": 0.4,
    "Negative electrode exchange-current density [A.m-2]": 0.4,
    "Positive electrode exchange-current density [A.m-2]": 0.4,
    "Electrolyte conductivity [S.m-1]": 0.1,
    "Electrolyte diffusivity [m2.s-1]": 0.15,
}
"""Typical logarithms by which a cell differs from its parameter set."""

_SHORT = {
    "any": ("pulses",),
    "thermal": ("fast",),
    "charge": ("cycle",),
    "ambients": ("fast", "fast"),
    "ageing": ("ageing",),
}
"""Records by what an effect needs to be seen; an hour or two each, but for ageing."""

AMBIENTS_C = (5.0, 15.0, 25.0, 35.0, 45.0)


@dataclass(frozen=True)
class Draw:
    """One case."""

    setting: Setting  # What is hidden.
    hidden: Hidden  # The cell.
    protocols: tuple[str, ...]  # Tests of the fitted records, and of the one that is held out, which is the last.
    ambients_c: tuple[float, ...]  # Ambient temperature of each, degC.
    socs: tuple[float, ...]  # State of charge at which each begins.


def setting_of(seed: int, number: int) -> Setting:
    """What is hidden in case ``number`` (from 0): every block of twenty has its quotas, in an order of its own."""
    block, place = divmod(number, BLOCK)
    order = [setting for setting, count in QUOTAS.items() for _ in range(count)]
    np.random.default_rng([seed, block, 1]).shuffle(order)
    return order[place]


def draw(seed: int, number: int, attempt: int = 0) -> Draw:
    """Draw a case.

    Of the set of a seed, counted from 0. Another ``attempt`` is another cell of the same setting, for one that cannot
    be simulated.
    """
    rng = np.random.default_rng([seed, number, attempt, 2])
    setting = setting_of(seed, number)
    model = "DFN" if rng.random() < DFN_SHARE else "SPMe"
    effects = drawn_effects(setting, rng)
    if effects and model not in effects[0].models:
        model = effects[0].models[0]
    chemistry = str(rng.choice(CHEMISTRIES))
    size = _capacity_ah(chemistry) / 5.0
    strengths = {effect.strength: drawn_strength(effect, size, rng) for effect in effects}
    outside = str(rng.choice(list(OUTSIDE))) if setting == "outside" else ""
    hidden = Hidden(
        chemistry,
        model,
        effects,
        strengths,
        _shifts(rng),
        noise_v=log_uniform(*NOISE_V, rng),
        heavy_tailed=bool(rng.random() < 0.5),
        resolution_v=float(rng.choice(RESOLUTIONS_V)),
        points=int(rng.integers(*MESH_POINTS)),
        outside=outside,
        outside_strength=log_uniform(*OUTSIDE[outside][1:], rng) if outside else 0.0,
    )
    protocols = _protocols({effect.records for effect in effects}, rng)
    return Draw(setting, hidden, protocols, *_conditions(effects, protocols, rng))


def draw_short(seed: int, number: int, attempt: int = 0) -> Draw:
    """Draw a case with one effect, one or two short records and SPMe, whose score test takes less than a minute.

    The effects come in turn, so that the first cases hide each of them once.
    """
    rng = np.random.default_rng([seed, number, attempt, 4])
    known = [effect for effect in EFFECTS if "SPMe" in effect.models]
    effect = known[number % len(known)]
    chemistry = str(rng.choice(CHEMISTRIES))
    strength = drawn_strength(effect, _capacity_ah(chemistry) / 5.0, rng)
    hidden = Hidden(chemistry, "SPMe", (effect,), {effect.strength: strength}, _shifts(rng), points=25)
    fitted = _SHORT[effect.records]
    protocols = (*fitted, fitted[0])
    return Draw("single", hidden, protocols, *_conditions((effect,), protocols, rng))


@cache
def _capacity_ah(chemistry: str) -> float:
    return float(pybamm.ParameterValues(chemistry)["Nominal cell capacity [A.h]"])


def drawn_effects(
    setting: Setting, rng: np.random.Generator, among: Sequence[HiddenEffect] = EFFECTS
) -> tuple[HiddenEffect, ...]:
    """The effects of the catalogue that a case hides."""
    if setting in ("none", "outside"):
        return ()
    if setting == "single":
        return (among[int(rng.integers(len(among)))],)
    while True:
        first, second = (among[int(k)] for k in rng.choice(len(among), 2, replace=False))
        if not (first.alone or second.alone or first.name == second.name) and _go_together(first, second):
            return first, second


def _go_together(first: HiddenEffect, second: HiddenEffect) -> bool:
    """Whether no option and no kind of record stands against having both."""
    options: Any = {**first.options, **second.options}
    alike = all(options[name] == value for name, value in first.options.items())
    return alike and not ({first.records, second.records} >= {"ageing", "ambients"})


def drawn_strength(effect: HiddenEffect, size: float, rng: np.random.Generator) -> float:
    """The strength of an effect in a cell of ``size`` times 5 A.h."""
    scale = {"": 1.0, "current": size, "resistance": 1.0 / size}[effect.scale]
    sign = -1.0 if effect.signed and rng.random() < 0.5 else 1.0
    return effect.null + sign * scale * log_uniform(effect.low, effect.high, rng)


def _shifts(rng: np.random.Generator) -> dict[str, float]:
    """A random share of the parameters, by random amounts."""
    share, width = float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.5, 1.5))
    moved = {name: spread for name, spread in SPREADS.items() if rng.random() < share}
    return {name: float(np.exp(width * spread * np.clip(rng.normal(), -2.0, 2.0))) for name, spread in moved.items()}


def _protocols(needs: set[str], rng: np.random.Generator) -> tuple[str, ...]:
    if "ageing" in needs:
        return ("ageing",) * int(rng.integers(2, 4))
    # Another temperature is another record.
    count = int(rng.integers(2 if "ambients" in needs else 1, 5)) + 1
    drawn = [str(name) for name in rng.choice(NAMES, count)]
    for need, test in (("thermal", "fast"), ("charge", "cycle")):
        # It must be among those that are fitted.
        if need in needs and test not in drawn[:-1]:
            drawn[int(rng.integers(count - 1))] = test
    return tuple(drawn)


def _conditions(
    effects: tuple[HiddenEffect, ...], protocols: tuple[str, ...], rng: np.random.Generator
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    count = len(protocols)
    needed = any(effect.records == "ambients" for effect in effects)
    ambients = rng.choice(AMBIENTS_C, count) if needed or rng.random() < 0.25 else np.full(count, 25.0)
    if needed and np.ptp(ambients[:-1]) < 10.0:
        ambients[0], ambients[1] = 5.0, 35.0
    socs = rng.uniform(0.85, 0.97, count)
    return tuple(float(a) for a in ambients), tuple(float(s) for s in socs)


def log_uniform(low: float, high: float, rng: np.random.Generator) -> float:
    """A number whose logarithm is drawn evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
