"""From a benchmark case to a task that a run can take."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ...core.errors import BsaError
from ...core.task import Task
from .case import SuiteCase
from .target import cell_of, experiment_of, target_of

_SEARCHED = {"sei": "sei", "life": "ageing"}
"""Search-space preset by the mode of a case."""


class NoTarget(BsaError):
    """PyBaMM cannot simulate the true cell of a case."""


def build_task(case: SuiteCase, search: str | Mapping[str, Any] | None = None) -> Task:
    """The task of a case: its base cell, its target, and generic physical bounds.

    The search space is given as in `resolve_space`; by default it is ``geometry``, or ``sei`` or ``ageing`` for the
    ageing cases. Raises `NoTarget` if the true cell cannot be simulated at all.
    """
    from ...plugins.pybamm.before_search.presets import resolve_space

    cell = cell_of(case)
    run = target_of(case)
    experiment = experiment_of(case)
    reached = run.trajectory
    if reached is None or (experiment.scored_cycle is not None and experiment.scored_cycle not in reached.cycles):
        reason = run.failure.cause if run.failure else "it ends before the scored cycle"
        raise NoTarget(f"{case.key}: PyBaMM cannot simulate the true cell ({reason}).", "leave the case out.")
    notes: tuple[str, ...] = ()
    if run.failure is not None:
        notes = (f'The target itself stops in "{run.failure.step}" ({run.failure.cause}); what it reached is scored.',)
    space = resolve_space(case.parameter_set, search or _SEARCHED.get(case.mode, "geometry"), {}, cell.options)
    return Task(case.key, cell, space, (replace(experiment, target=reached),), notes)
