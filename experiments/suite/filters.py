"""The two filters of the paper: a case must run, and must differ from its base cell by 1 % of capacity."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from .case import Noise, SuiteCase
from .target import cell_of, discharged_in_scored_part, experiment_of, reference_run

LEAST_CAPACITY_CHANGE = 0.01


def passes(case: SuiteCase, cache: Path | None = None) -> bool:
    """Whether the true cell runs to its end and its capacity differs by 1 % or more from the base cell's.

    A base cell that cannot run the protocol differs enough.

    Parameters
    ----------
    case : SuiteCase
        The case.
    cache : Path, optional
        Folder for finished targets.
    """
    if not case.changes:
        return False
    quiet = replace(case, noise=Noise())
    cell, experiment = cell_of(quiet), experiment_of(quiet)
    true = discharged_in_scored_part(reference_run(cell, experiment, quiet.hidden, cache), experiment)
    if true is None:
        return False
    base = discharged_in_scored_part(reference_run(cell, experiment, {}, cache), experiment)
    return base is None or abs(true - base) >= LEAST_CAPACITY_CHANGE * base
