"""Our own ageing cases: what limits the SEI's growth x lithium plating x loss of active material, drawn by seed.

Nothing but the benchmark reads this module: no proposer, prior or rule knows these ranges.
"""

import math
from collections.abc import Mapping

import numpy as np

from ...core.target import Factor, target_named
from .case import SuiteCase

MODE = "life"
SET, RATE = "Chen2020", 1.0

Mechanism = tuple[Mapping[str, str], str, tuple[float, float]]
"""Model options, the hidden parameter, and the range of its value: factors of the set's own, or of 1 for a multiplier.
"""

GROWTH: tuple[Mechanism, ...] = (
    ({"SEI": "reaction limited"}, "SEI reaction exchange current density [A.m-2]", (1.5, 10.0)),
    ({"SEI": "solvent-diffusion limited"}, "SEI solvent diffusivity [m2.s-1]", (10.0, 100.0)),
    ({"SEI": "electron-migration limited"}, "SEI electron conductivity [S.m-1]", (5.0, 100.0)),
    ({"SEI": "interstitial-diffusion limited"}, "SEI lithium interstitial diffusivity [m2.s-1]", (20.0, 100.0)),
    ({"SEI": "ec reaction limited"}, "EC diffusivity [m2.s-1]", (0.012, 0.1)),
)
"""Taken in turn. Over 200 cycles these rates take 0.5 to 15 % of the capacity (SPM, 1C)."""

_PLATING = "Exchange-current density for plating [A.m-2] factor"
_NOTHING: Mechanism = ({}, "", (1.0, 1.0))

PLATING: tuple[Mechanism, ...] = (
    _NOTHING,
    ({"lithium plating": "irreversible"}, _PLATING, (0.01, 0.02)),
    ({"lithium plating": "partially reversible"}, _PLATING, (10.0, 100.0)),
)

MATERIAL: tuple[Mechanism, ...] = (
    _NOTHING,
    (
        {"particle mechanics": "swelling only", "loss of active material": "stress-driven"},
        "Negative electrode LAM constant proportional term [s-1]",
        (3.0, 30.0),
    ),
)


def life_cases(seed: int, count: int = 20, cycles: int = 200) -> dict[str, SuiteCase]:
    """Ageing cases by key (``life-0``, ``life-1``, ...).

    A case depends on the seed and on its own number, not on how many are asked for.
    """
    cases = (_draw(seed, number, cycles) for number in range(count))
    return {case.key: case for case in cases}


def _draw(seed: int, number: int, cycles: int) -> SuiteCase:
    rng = np.random.default_rng([seed, number])
    chosen = [
        GROWTH[number % len(GROWTH)],
        PLATING[int(rng.integers(len(PLATING)))],
        MATERIAL[int(rng.integers(len(MATERIAL)))],
    ]
    options = {name: value for mechanism, _, _ in chosen for name, value in mechanism.items()}
    changes = {
        name: _base(name) * math.exp(rng.uniform(math.log(low), math.log(high)))
        for _, name, (low, high) in chosen
        if name
    }
    return SuiteCase(MODE, number, SET, RATE, RATE, changes, cycles=cycles, growth=options)


def _base(name: str) -> float:
    from ...plugins.pybamm.cells.parameter_sets import initial_value

    return 1.0 if isinstance(target_named(name), Factor) else initial_value(SET, name)
