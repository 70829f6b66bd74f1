"""The blind cases: what is hidden, in which chemistry, seen through which test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.effect import Effect
from ...core.task import CellModel
from .hidden_cell import Hidden

SHIFTS = {
    "Negative electrode active material volume fraction factor": 0.04,
    "Positive electrode active material volume fraction factor": 0.04,
    "Cyclable lithium factor": 0.01,
    "Negative particle radius [m] factor": 0.12,
    "Positive particle radius [m] factor": 0.12,
    "Negative particle diffusivity [m2.s-1] factor": 0.4,
    "Positive particle diffusivity [m2.s-1] factor": 0.4,
    "Negative electrode exchange-current density [A.m-2] factor": 0.4,
    "Positive electrode exchange-current density [A.m-2] factor": 0.4,
    "Electrolyte conductivity [S.m-1] factor": 0.1,
    "Electrolyte diffusivity [m2.s-1] factor": 0.15,
}
"""Standard deviations of the logarithms by which the hidden cell differs from the parameter set."""

GENERAL = ("slow", "pulses")
THERMAL = ("slow", "fast")
AGEING = ("ageing",)


@dataclass(frozen=True)
class Recipe:
    """One case.

    Attributes
    ----------
    effects : tuple of str
        Keys of the hidden effects; empty for none.
    strengths : tuple of float
        Their strengths, for a cell of 5 A.h; amperes and ohms scale with the cell.
    profiles : tuple of str
        Fitted records; the hold-out is always ``check`` (or a second ageing record).
    setting : {'weak', 'strong', 'none', 'outside', 'pair'}
        What the case is for.
    chemistry : str
        PyBaMM parameter set.
    model : str
        Base model.
    ambients_c : tuple of float
        Ambient temperature of each record, the hold-out last; empty for 25 degC.
    outside : str
        An effect that no catalogue has.
    """

    effects: tuple[str, ...]
    strengths: tuple[float, ...]
    profiles: tuple[str, ...]
    setting: str
    chemistry: str
    model: str = "SPMe"
    ambients_c: tuple[float, ...] = ()
    outside: str = ""


CHEMISTRIES = ("Chen2020", "Marquis2019", "Mohtat2020", "OKane2022")

_SINGLES: tuple[tuple[str, float, float, tuple[str, ...]], ...] = (
    ("contact-resistance", 0.004, 0.015, GENERAL),
    ("self-heating", 3.0, 12.0, THERMAL),
    ("temperature-dependence", 10.0, 35.0, ("slow", "pulses", "cccv")),
    ("double-layer-capacitance", 5.0, 50.0, GENERAL),
    ("ocp-hysteresis", 0.005, 0.025, ("cccv", "pulses")),
    ("particle-size-distribution", 0.25, 0.5, GENERAL),
    ("electrolyte-transport", 0.4, 1.0, GENERAL),
    ("solid-diffusivity-variation (positive electrode)", 1.0, 3.0, GENERAL),
    ("stress-induced-diffusion (positive electrode)", 0.5, 3.0, GENERAL),
    ("kinetics-marcus", 1.0, 3.0, ("fast", "pulses")),
    ("sei-growth (reaction-limited)", 10.0, 60.0, AGEING),
    ("sei-growth (diffusion-limited)", 200.0, 3000.0, AGEING),
    ("lithium-plating", 30.0, 300.0, AGEING),
    ("loss-of-active-material (positive electrode)", 1e-3, 4e-3, AGEING),
    ("porosity-change", 3e-3, 1.5e-2, AGEING),
    ("self-discharge", 0.01, 0.05, ("slow", "cccv")),
    ("current-gain", 1.01, 1.04, GENERAL),
    ("current-offset", -0.01, -0.05, ("slow", "cccv")),
    ("voltage-offset", 0.003, 0.015, GENERAL),
    ("time-lag", 0.5, 2.0, ("slow", "drive")),
)

_PAIRS = (
    (("contact-resistance", "self-heating"), (0.012, 8.0), ("slow", "fast", "pulses")),
    (("ocp-hysteresis", "contact-resistance"), (0.02, 0.012), ("cccv", "pulses")),
    (("contact-resistance", "voltage-offset"), (0.012, 0.01), GENERAL),
)

_OUTSIDE = (
    ("soc-dependent-resistance", 0.01, GENERAL),
    ("saturating-overpotential", 0.02, GENERAL),
    ("slow-memory", 0.02, GENERAL),
    ("drifting-reference", 0.004, ("slow", "cccv")),
)


def recipes() -> Iterator[Recipe]:
    """All cases, in an order in which any prefix is a fair mixture."""
    nulls = [Recipe((), (), p, "none", c) for c in CHEMISTRIES for p in (GENERAL, ("cccv", "fast"))]
    strong, weak = [], []
    for number, (key, low, high, profiles) in enumerate(_SINGLES):
        chemistry = CHEMISTRIES[number % len(CHEMISTRIES)]
        model = "SPM" if key == "electrolyte-transport" else "SPMe"
        if key.startswith("lithium-plating"):
            chemistry = "OKane2022"
        ambients = (10.0, 25.0, 40.0, 25.0) if key == "temperature-dependence" else ()
        strong.append(Recipe((key,), (high,), profiles, "strong", chemistry, model, ambients))
        other = CHEMISTRIES[(number + 1) % len(CHEMISTRIES)]
        other = chemistry if key.startswith("lithium-plating") else other
        weak.append(Recipe((key,), (low,), profiles, "weak", other, model, ambients))
    pairs = [
        Recipe(keys, strengths, profiles, "pair", CHEMISTRIES[k % len(CHEMISTRIES)])
        for k, (keys, strengths, profiles) in enumerate(_PAIRS)
    ]
    outside = [
        Recipe((), (strength,), profiles, "outside", CHEMISTRIES[k % len(CHEMISTRIES)], outside=name)
        for k, (name, strength, profiles) in enumerate(_OUTSIDE)
    ]
    streams: list[list[Recipe]] = [strong, weak, nulls, pairs + outside]
    lengths = [len(stream) for stream in streams]
    # Evenly interleaved: each stream advances in proportion to its length.
    taken = [0] * len(streams)
    for _ in range(sum(lengths)):
        behind = min(
            (k for k in range(len(streams)) if taken[k] < lengths[k]), key=lambda k: (taken[k] + 0.5) / lengths[k]
        )
        yield streams[behind][taken[behind]]
        taken[behind] += 1


def hide(recipe: Recipe, effects: Sequence[Effect], capacity_ah: float, rng: np.random.Generator) -> Hidden:
    """Draw the hidden cell of a case: strengths to the cell's size, shifted parameters, noise of 0.5 to 2 mV."""
    by_key = {effect.key: effect for effect in effects}
    size = capacity_ah / 5.0
    chosen: list[Effect] = []
    strengths: dict[str, float] = {}
    for key, strength in zip(recipe.effects, recipe.strengths, strict=False):
        effect = by_key[key]
        unit = effect.strength.unit
        scale = size if unit == "A" else 1 / size if unit in ("Ohm", "K.W-1") else 1.0
        chosen.append(effect)
        strengths |= {effect.full_name(p): p.probe for p in effect.parameters}
        strengths[effect.full_name(effect.strength)] = strength * scale
    noise = float(np.exp(rng.uniform(np.log(5e-4), np.log(2e-3))))
    shifts = {name: float(np.exp(np.clip(rng.normal(), -2, 2) * spread)) for name, spread in SHIFTS.items()}
    outside = recipe.strengths[0] if recipe.outside else 0.0
    return Hidden(tuple(chosen), strengths, shifts, noise, recipe.outside, outside)


def base_cell(recipe: Recipe) -> CellModel:
    """The model that the discovery starts from."""
    return CellModel(recipe.chemistry, recipe.model)
