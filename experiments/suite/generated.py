"""Our own suite: Base -> Perturb -> Filter with a fixed seed, by the paper's tables.

The finished list is ``generated_cases.yaml``. Regenerate it (20 minutes) with::

    python -m bsa.experiments.suite.generated

Nothing but the benchmark reads this module or its list: no proposer, prior or rule knows these tables.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ...core.files import write_text
from ...core.yaml_text import read_yaml
from .case import SuiteCase
from .filters import CompiledFilter

SETS = ("Chen2020", "ORegan2022", "Ecker2015", "Prada2013", "Marquis2019")
RATES = (0.2, 1.0, 2.0)
SEED = 2026
"""Of the order in which combinations are tried."""

PER_SET_AND_MODE = 20
CASES_FILE = Path(__file__).with_name("generated_cases.yaml")

RADII = ("Negative particle radius [m]", "Positive particle radius [m]")
THICKNESSES = ("Negative electrode thickness [m]", "Positive electrode thickness [m]")
POROSITIES = ("Negative electrode porosity", "Positive electrode porosity")
BRUGGEMAN = (
    "Negative electrode Bruggeman coefficient (electrolyte)",
    "Positive electrode Bruggeman coefficient (electrolyte)",
)
SEPARATOR = "Separator thickness [m]"
COLUMNS = (*RADII, *THICKNESSES, *POROSITIES, *BRUGGEMAN, SEPARATOR)

COMBINATIONS = (
    (0.7, 0.7, 0.85, 0.9, +0.04, +0.04, 1.5, 1.5, 0.9),
    (1.0, 1.0, 1.10, 1.25, -0.02, -0.03, 1.7, 1.7, 1.0),
    (1.0, 1.0, 1.00, 1.25, 0.00, -0.05, 1.6, 2.0, 1.2),
    (1.5, 1.5, 1.00, 1.0, 0.00, 0.00, 1.7, 1.7, 1.0),
    (1.8, 1.0, 1.15, 1.0, 0.00, 0.00, 1.7, 1.7, 1.0),
    (1.0, 1.8, 1.00, 1.15, 0.00, 0.00, 1.7, 1.7, 1.0),
    (1.0, 1.0, 1.10, 1.10, +0.06, +0.06, 1.5, 1.5, 1.0),
    (1.0, 1.0, 1.00, 1.0, -0.06, -0.06, 2.0, 2.0, 1.2),
    (0.7, 1.4, 1.00, 1.1, 0.00, 0.00, 1.7, 1.7, 1.0),
    (1.4, 0.7, 1.10, 1.0, 0.00, 0.00, 1.7, 1.7, 1.0),
    (1.0, 1.0, 1.20, 1.25, -0.02, -0.03, 1.7, 1.7, 0.85),
    (1.0, 1.0, 1.10, 1.10, -0.04, -0.04, 1.9, 1.9, 1.5),
)
"""The twelve combinations of the regular mode, a value for each of `COLUMNS`: factors for radii and
thicknesses, additions for porosities, Bruggeman coefficients as they are (paper, Appendix B)."""

EXTREMES: Mapping[str, tuple[float, ...]] = {
    **dict.fromkeys(RADII, (0.5, 2.0)),
    **dict.fromkeys(THICKNESSES, (0.75, 1.5)),
    **dict.fromkeys(POROSITIES, (-0.05, +0.05)),
    BRUGGEMAN[0]: (1.5, 2.0, 2.5),
    BRUGGEMAN[1]: (1.3, 1.8, 2.3),
    SEPARATOR: (0.7, 1.3),
}
"""The rules of the extreme mode, in the same units (paper, Table of nine rules)."""

EXTREME_POROSITY = (0.2, 0.6)


def perturbations(base: Mapping[str, Any]) -> dict[str, list[dict[str, float]]]:
    """The true values by mode, in the order of the tables."""
    regular = [
        {name: _changed(base, name, value) for name, value in zip(COLUMNS, combination, strict=True)}
        for combination in COMBINATIONS
    ]
    extreme = []
    for name, values in EXTREMES.items():
        for value in values:
            true = _changed(base, name, value)
            if name in POROSITIES:
                true = min(max(true, EXTREME_POROSITY[0]), EXTREME_POROSITY[1])
            extreme.append({name: true})
    return {"regular": regular, "extreme": extreme}


def _changed(base: Mapping[str, Any], name: str, value: float) -> float:
    own = float(base[name])
    if name in BRUGGEMAN:
        return value
    return own + value if name in POROSITIES else own * value


def all_cases() -> Iterator[SuiteCase]:
    """Every combination of base cell, rates and rule, before the filters, numbered within its mode."""
    from ...plugins.pybamm.cells.parameter_sets import load

    numbers = {"regular": 0, "extreme": 0}
    for parameter_set in SETS:
        by_mode = perturbations(load(parameter_set))
        for charge, discharge in product(RATES, RATES):
            for mode, truths in by_mode.items():
                for changes in truths:
                    yield SuiteCase(mode, numbers[mode], parameter_set, charge, discharge, changes)
                    numbers[mode] += 1


def generate(keep: Callable[[SuiteCase], bool]) -> list[SuiteCase]:
    """Draw cases at random and filter them by ``keep`` until each base cell and mode has enough."""
    pools: dict[tuple[str, str], list[SuiteCase]] = {}
    for case in all_cases():
        pools.setdefault((case.mode, case.parameter_set), []).append(case)
    chosen: list[SuiteCase] = []
    for place, pool in enumerate(pools.values()):
        drawn = (pool[index] for index in np.random.default_rng([SEED, place]).permutation(len(pool)))
        chosen += islice(filter(keep, drawn), PER_SET_AND_MODE)
    return sorted(chosen, key=lambda case: (case.mode, case.number))


def generated_cases() -> dict[str, SuiteCase]:
    """The cases of the finished list, by key."""
    cases = [
        SuiteCase(
            entry["mode"], entry["number"], entry["set"], entry["charge"], entry["discharge"], dict(entry["changes"])
        )
        for entry in read_yaml(CASES_FILE)["cases"]
    ]
    return {case.key: case for case in cases}


def write(cases: list[SuiteCase], path: Path = CASES_FILE) -> None:
    """Write the finished list."""
    entries = [
        {
            "mode": case.mode,
            "number": case.number,
            "set": case.parameter_set,
            "charge": case.charge_rate,
            "discharge": case.discharge_rate,
            "changes": {name: float(f"{value:.12g}") for name, value in case.changes.items()},
        }
        for case in cases
    ]
    head = f"# Made by: python -m bsa.experiments.suite.generated   (seed {SEED})\n"
    lines = "".join(
        f"  - {yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10_000)}" for entry in entries
    )
    write_text(path, f"{head}cases:\n{lines}")


if __name__ == "__main__":
    _passes = CompiledFilter(COLUMNS)

    def _reported(case: SuiteCase) -> bool:
        kept = _passes(case)
        print(f"{case.key} {case.parameter_set} {case.rates}: {'kept' if kept else 'dropped'}", file=sys.stderr)
        return kept

    write(generate(_reported))
