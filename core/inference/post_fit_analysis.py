"""After a fit: what the records fix, and which further record would narrow most of what they leave open.

Nothing here counts as a simulation of the search: it begins when the search has ended.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..ageing.fade_band import FadeBand
from ..ageing.residuals import CAPACITY_TOLERANCE, compared_cycles
from ..comparison.residuals import capacity_rows, residuals
from ..prior import Prior
from ..rms import rms
from ..shape import shaped
from ..task import Task
from ..trajectory import FloatArray
from ..trial import Trial
from .derivatives import DIFFERENCE, known_derivatives
from .identifiability import Identifiability, identify, not_narrower, unsettled, with_sample
from .measure_next import Suggestion, suggestions
from .residual_errors import Errors, errors_of
from .simulated_posterior import SimulatedPosterior, simulated_posterior
from .simulating import Simulating, Spent

_OF_A_LIFE = {"rounds": 1, "at_once": 16}
"""Simulations at draws from the posterior, where each takes minutes."""

_FEWEST_FOLLOWED = 5
"""Simulated points that tell how far a prediction is open; from fewer a band would be many times their deviation."""


@dataclass(frozen=True)
class PostFitAnalysis:
    """What is known after a fit."""

    base: int  # Index of the trial that was judged.
    identifiability: Identifiability  # What the records fix there.
    # Parameters whose derivative could not be had (their neighbours fail); they count as undetermined.
    unknown: tuple[str, ...] = ()
    # Parameters that one more step of the fit would move beyond their interval: it had not converged.
    unsettled: tuple[str, ...] = ()
    worst: str = ""  # The parameter with the widest interval.
    # Further records, the one that would shrink the widest interval most first; empty if nothing is left open, or the
    # simulator does not know other protocols.
    measure_next: tuple[Suggestion, ...] = ()
    simulations: int = 0  # Simulations it took, none of which counts for the search; each suggested record is one.
    reused: int = 0  # Derivatives that trials of the search had shown already.
    seconds: float = 0.0  # Wall time of these simulations, those that ran side by side added up.
    fade: tuple[FadeBand, ...] = ()  # Of each whole life the band of its capacity by cycle.
    budget: int = 0  # Simulations that it might take: as many as the search was allowed.
    # Factor by which the noise was raised because draws did not come out as predicted; 1 if they did.
    widened: float = 1.0
    cut_short: bool = True  # Whether the budget ended the sample, rather than its number of rounds.
    forgone: int = 0  # Simulations by which the budget does not suffice for further records; those are not looked for.

    def as_json(self) -> dict[str, Any]:
        """Plain dicts, sequences, strings and numbers; what the records fix stands at the top level."""
        content = asdict(self)
        found = content.pop("identifiability")
        singular_values = [combination["singular_value"] for combination in found["combinations"]]
        return {**found, "singular_values": singular_values, **content}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> PostFitAnalysis:
        """The inverse of `as_json`, of earlier versions' too. Raises `ValueError` where it is of another shape."""
        return shaped(cls, {**content, "identifiability": content})  # type: ignore[no-any-return]


def analyse(
    task: Task, trials: Sequence[Trial], best: Trial, plugins: Simulating, budget: int, priors: bool = False
) -> PostFitAnalysis | None:
    """Judge the fit that a run ended with; None if the best candidate did not run to its end.

    ``trials`` are all that were tried: finite differences near the best candidate are not simulated again. It may take
    ``budget`` simulations, as many as the search was allowed; some are made in any case. What the search left of them
    may go to further records. ``priors`` is whether the search weighed the priors of the search space.
    """
    if best.residuals is None:
        return None
    spent = Spent(budget, unused=max(budget - len(trials), 0))
    jacobian, reused, unknown, looked = _jacobian(task, trials, best, plugins, spent)
    errors = errors_of(task, best, plugins, spent)
    residual = best.residuals + errors.shift
    prior, centre = Prior.of(task.space, priors), task.space.to_unit(best.candidate)
    sampled = _posterior(task, trials, best, looked, jacobian, errors, prior, plugins, spent)
    # In tolerances still, and each as much as its deviation allows.
    overall = rms(errors.deviation)
    weights, noise = overall / errors.deviation, sampled.excess * overall
    informed, weighed = prior.jacobian(weights[:, None] * jacobian, noise), weights * residual
    straight = identify(informed, weighed, task.space, best.candidate, noise)
    found = with_sample(straight, sampled.draws, task.space, sampled.holds_best)
    if len(sampled.followed) > _FEWEST_FOLLOWED:
        found = replace(found, draws=tuple(tuple(point) for point in sampled.followed.tolist()))
    if sampled.widened > 1.0:
        # A sample that ended early may not have reached the ends of a valley.
        found = not_narrower(found, straight, task.space)
    now = {name: found.intervals[name].share_of_range for name in task.space.names}
    found_next, forgone = suggestions(task, best, informed, noise, now, plugins, spent)
    worst = max(now, key=lambda name: now[name])
    moving = unsettled(informed, prior.residuals(weighed, centre, noise), noise, task.space.names, centre)
    fade = _fade_bands(task, residual, jacobian, found.covariance)
    return PostFitAnalysis(
        best.index,
        found,
        unknown,
        moving,
        worst,
        found_next,
        spent.simulations,
        reused,
        spent.seconds,
        fade,
        spent.budget,
        sampled.widened,
        sampled.cut_short,
        forgone,
    )


def _fade_bands(
    task: Task, residual: FloatArray, jacobian: FloatArray, covariance: Sequence[Sequence[float]]
) -> tuple[FadeBand, ...]:
    """The bands of the capacities of fitted lives, from the derivatives that are known anyway."""
    tables = [e.target.cycle_table for e in task.experiments if e.target.cycle_table is not None]
    bands = []
    for table, rows in zip(tables, capacity_rows(task), strict=True):
        picks = compared_cycles(table)
        unit_ah = CAPACITY_TOLERANCE * table.capacity_ah[picks]
        scatter_ah = rms(residual[rows] * unit_ah)
        slopes = jacobian[rows] * unit_ah[:, None]
        bands.append(FadeBand.propagated(table.cycle[picks], slopes, covariance, scatter_ah))
    return tuple(bands)


def _posterior(
    task: Task,
    trials: Sequence[Trial],
    best: Trial,
    looked: Sequence[tuple[FloatArray, FloatArray]],
    jacobian: FloatArray,
    errors: Errors,
    prior: Prior,
    plugins: Simulating,
    spent: Spent,
) -> SimulatedPosterior:
    """A sample of the posterior in the unit box."""
    assert best.residuals is not None
    space = task.space
    slopes = jacobian / errors.deviation[:, None]

    def simulate(points: FloatArray) -> list[FloatArray | None]:
        candidates = [space.from_unit(point) for point in points]
        seen = [residuals(task, outcome) for outcome in spent.counted(plugins.simulate(candidates, False), 1)]
        return [None if residual is None else errors.whitened(residual) for residual in seen]

    known = [(space.to_unit(trial.candidate), trial.residuals) for trial in trials if trial.residuals is not None]
    known = [(space.to_unit(best.candidate), best.residuals), *known, *looked]
    return simulated_posterior(
        [point for point, _ in known],
        [errors.whitened(residual) for _, residual in known],
        slopes,
        simulate,
        prior,
        most=spent.left,
        **(_OF_A_LIFE if task.long else {}),
    )


def _jacobian(
    task: Task, trials: Sequence[Trial], best: Trial, plugins: Simulating, spent: Spent
) -> tuple[FloatArray, int, tuple[str, ...], list[tuple[FloatArray, FloatArray]]]:
    """The Jacobian, how many of its columns the search knew, what could not be had, and what was simulated for it.

    Derivatives that could not be had are zero.
    """
    assert best.residuals is not None
    space = task.space
    looked: list[tuple[FloatArray, FloatArray]] = []
    centre = space.to_unit(best.candidate)
    known = known_derivatives(trials, best, space)
    columns = dict(known)
    side = np.where(centre <= 0.5, 1.0, -1.0)
    for attempt in (1.0, -1.0):
        # A neighbour that fails on one side may run on the other.
        missing = [place for place in range(len(space)) if place not in columns]
        if not missing:
            break
        points = []
        for place in missing:
            point = centre.copy()
            point[place] = np.clip(point[place] + attempt * side[place] * DIFFERENCE, 0.0, 1.0)
            points.append(point)
        outcomes = spent.counted(plugins.simulate([space.from_unit(point) for point in points], False), 1)
        for place, point, outcome in zip(missing, points, outcomes, strict=True):
            change = float(point[place] - centre[place])
            there = residuals(task, outcome)
            if there is not None and change != 0.0:
                looked.append((point, there))
                columns[place] = (there - best.residuals) / change
    unknown = tuple(name for place, name in enumerate(space.names) if place not in columns)
    jacobian = np.zeros((len(best.residuals), len(space)))
    for place, column in columns.items():
        jacobian[:, place] = column
    return jacobian, len(known), unknown, looked
