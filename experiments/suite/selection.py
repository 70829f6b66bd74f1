"""Which cases a study takes: a suite by name, and a part of it that stands for the whole."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from itertools import zip_longest
from pathlib import Path
from typing import Literal

import numpy as np

from ...core.errors import BsaError, did_you_mean
from .case import SuiteCase
from .generated import generated_cases
from .lives import life_cases
from .published import published_cases
from .random import random_cases

Suite = Literal["published", "generated", "random", "lives"]

_LEAVE_OUT_UNLESS_NAMED = "sei"


def load_suite(
    name: Suite = "published", folder: Path | None = None, seed: int = 1, count: int = 40, noise_v: float = 0.0
) -> dict[str, SuiteCase]:
    """The cases of a suite, by key.

    Seed and count are of the random suite and of lives; noise is put on the voltage of every target. Raises `BsaError`
    if the files of the suite are missing.
    """
    if name == "random":
        cases = random_cases(seed, count)
    elif name == "lives":
        cases = life_cases(seed, count)
    else:
        cases = generated_cases() if name == "generated" else published_cases(folder)
    return {key: replace(case, noise_v=noise_v) for key, case in cases.items()}


def choose(
    cases: Mapping[str, SuiteCase], wanted: int | str | Sequence[str] | None = None, seed: int = 0
) -> dict[str, SuiteCase]:
    """A part of a suite.

    ``wanted`` is a number (taken in turn from every mode and base cell, so that 10 of the published suite are one of
    each; the seed says which), keys or patterns (``"regular-134"``, ``"extreme-*"``, or several joined by commas); all
    by default. Ageing cases come only when named: they take hours. Raises `BsaError` if a key or pattern fits no case.
    """
    ordinary = {key: case for key, case in cases.items() if case.mode != _LEAVE_OUT_UNLESS_NAMED}
    if wanted is None:
        return ordinary
    if isinstance(wanted, int):
        if wanted < 1:
            raise BsaError(f"the number of cases must be 1 or more, but got {wanted}.")
        return _spread(ordinary, wanted, seed)
    patterns = wanted.split(",") if isinstance(wanted, str) else list(wanted)
    chosen: dict[str, SuiteCase] = {}
    for pattern in (text.strip() for text in patterns):
        found = {key: case for key, case in cases.items() if fnmatch(key, pattern)}
        if not found:
            raise BsaError(
                f'no case is called "{pattern}".',
                did_you_mean(pattern, cases) or 'write keys such as "regular-134", or a pattern such as "extreme-*".',
            )
        chosen.update(found)
    return chosen


def _spread(cases: Mapping[str, SuiteCase], count: int, seed: int) -> dict[str, SuiteCase]:
    piles: dict[tuple[str, str], list[SuiteCase]] = {}
    for case in cases.values():
        piles.setdefault((case.mode, case.parameter_set), []).append(case)
    shuffled = [
        [pile[index] for index in np.random.default_rng([seed, place]).permutation(len(pile))]
        for place, pile in enumerate(piles.values())
    ]
    # The first of every pile, then the second of every pile: a larger choice holds every smaller one.
    turn = [case for layer in zip_longest(*shuffled) for case in layer if case is not None]
    taken = {case.key for case in turn[:count]}
    return {key: case for key, case in cases.items() if key in taken}
