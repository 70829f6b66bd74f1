"""Cases that no table describes: perturbations of random size, other base cells.

They show whether a proposer is good, or only knows the suite.
"""

import math
from collections.abc import Callable

import numpy as np

from .case import SuiteCase
from .filters import passes
from .generated import BRUGGEMAN, POROSITIES, RADII, SEPARATOR, THICKNESSES

SETS = ("Chen2020", "OKane2022", "Ecker2015", "Mohtat2020", "Prada2013", "Ai2020", "Marquis2019", "ORegan2022")
"""Base cells, taken in turn: the paper's five and three it does not use."""

RATES = (0.2, 0.5, 1.0, 1.5, 2.0)

_LARGEST_FACTOR = {**dict.fromkeys(RADII, 2.2), **dict.fromkeys(THICKNESSES, 1.5), SEPARATOR: 1.7}
_POROSITY_SHIFT, _POROSITY = 0.1, (0.15, 0.6)
_BRUGGEMAN_SHIFT, _BRUGGEMAN = 1.0, (1.05, 3.5)
_ATTEMPTS = 60


def random_cases(seed: int, count: int = 40, keep: Callable[[SuiteCase], bool] = passes) -> dict[str, SuiteCase]:
    """Random cases that pass the filters, by key (``random-0``, ``random-1``, ...).

    A case depends on the seed and on its own number, not on how many are asked for. ``keep`` replaces the paper's two
    filters.
    """
    cases = (_draw(seed, number, keep) for number in range(count))
    return {case.key: case for case in cases}


def _draw(seed: int, number: int, keep: Callable[[SuiteCase], bool]) -> SuiteCase:
    from ...plugins.pybamm.cells.parameter_sets import load

    rng = np.random.default_rng([seed, number])
    parameter_set = SETS[number % len(SETS)]
    base = load(parameter_set)
    names = [*_LARGEST_FACTOR, *POROSITIES, *BRUGGEMAN]
    for _ in range(_ATTEMPTS):
        chosen = rng.permutation(len(names))[: int(rng.integers(1, len(names) + 1))]
        changes = {names[index]: _perturbed(names[index], float(base[names[index]]), rng) for index in sorted(chosen)}
        charge, discharge = (float(rate) for rate in rng.choice(RATES, size=2))
        case = SuiteCase("random", number, parameter_set, charge, discharge, changes)
        if keep(case):
            break
    # The last draw stands where none passed: a case that no proposer can finish is reported, not hidden.
    return case


def _perturbed(name: str, value: float, rng: np.random.Generator) -> float:
    position = float(rng.uniform(-1.0, 1.0))
    if name in _LARGEST_FACTOR:
        return value * math.exp(position * math.log(_LARGEST_FACTOR[name]))
    shift, (lowest, highest) = (_POROSITY_SHIFT, _POROSITY) if name in POROSITIES else (_BRUGGEMAN_SHIFT, _BRUGGEMAN)
    return min(max(value + position * shift, lowest), highest)
