"""Records of many cycles, cut after their first ones: a cell is calibrated before it has aged."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..inference.observations import Observations, subset
from ..inference.problem import Problem
from ..trajectory import FloatArray

_NEW = 1
"""Cycles of a cell that counts as new. A strong SEI consumes a percent of the capacity in each."""

_FEWEST = 3
"""Cycles below which ageing cannot be seen."""

_DRIFT_V = 0.01
"""Typical error of a cycle up to which what ageing does to the voltage is nearly linear, V."""


def first_cycle(problem: Problem) -> Problem | None:
    """The same problem with long records cut after their first cycle; None where no record is long.

    Fitted to many cycles, the parameters of a model without ageing compensate for ageing.
    """
    long = [observed.measured_record.is_long for observed in problem.observations]
    return _cut(problem, [_NEW if there else None for there in long]) if any(long) else None


def near_cycles(problem: Problem, errors: Sequence[FloatArray]) -> Problem | None:
    """The same problem with records cut where the voltage of the new cell drifts far from theirs; None if it does not.

    ``errors`` are, by record, measured minus predicted voltage with the parameters of the first cycle, V.
    """
    counts = [_undrifted(observed, error) for observed, error in zip(problem.observations, errors, strict=True)]
    return None if all(count is None for count in counts) else _cut(problem, counts)


def longer(problem: Problem, near: Problem) -> Iterator[Problem]:
    """The same problem on twice as many cycles as ``near``, on four times as many and so on, up to fewer than all.

    Many cycles beyond those that were fitted a simulated cell is empty at the wrong time, and that is no start.
    """
    whole, counts = (
        [len(observed.measured_record.record.cycles) for observed in one.observations] for one in (problem, near)
    )
    counts = [2 * count for count in counts]
    while any(count < total for count, total in zip(counts, whole, strict=True)):
        yield _cut(problem, counts)
        counts = [2 * count for count in counts]


def _undrifted(observed: Observations, error: FloatArray) -> int | None:
    """How many cycles there are before the drift is large; None if it never is."""
    typical = [float(np.median(np.abs(error[observed.cycle == number]))) for number in np.unique(observed.cycle)]
    far = np.flatnonzero(np.array(typical) > _DRIFT_V)
    return max(_FEWEST, int(far[0])) if len(far) else None


def _cut(problem: Problem, counts: Sequence[int | None]) -> Problem:
    observations = [_first(*pair) for pair in zip(problem.observations, counts, strict=True)]
    sizes = {observed.name: len(observed) for observed in observations}
    return Problem(
        problem.simulator,
        observations,
        problem.held_observations,
        {name: change[: sizes.get(name)] for name, change in problem.corrections.items()},
        {name: sigma[: sizes.get(name)] for name, sigma in problem.mesh_sigma.items()},
        fitted=[mask[: len(observed)] for mask, observed in zip(problem.fitted, observations, strict=True)],
    )


def _first(observed: Observations, count: int | None) -> Observations:
    """One record's averages, cut after so many cycles, with the record."""
    record = observed.measured_record.record
    if count is None or count >= len(record.cycles):
        return observed
    last = record.cycles[count - 1]
    stop = max(step.stop for step in record.steps if step.cycle <= last)
    cut = replace(observed.measured_record, record=record.slice(0, stop))
    return replace(subset(observed, observed.cycle <= last), measured_record=cut)
