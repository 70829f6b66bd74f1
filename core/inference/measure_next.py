"""Which further record would narrow most of what the records leave open."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..comparison.residuals import residuals
from ..simulation import Outcome
from ..task import Experiment, Task
from ..task import Protocol as StepProtocol
from ..trajectory import SECONDS_PER_HOUR, FloatArray, Trajectory
from ..trial import Trial
from .derivatives import beside
from .identifiability import covariance_of, open_directions
from .simulating import Simulating, Spent

_ALONG = 0.02
"""Step along an undetermined direction: longer than a finite difference, since the residuals change little along it."""

_MOST_DIRECTIONS = 6
"""Undetermined directions along which protocols are simulated at most, the least known first."""

_FULL = 1.0
"""State of charge at which a suggested protocol begins."""


@dataclass(frozen=True)
class Suggestion:
    """A further record, and what it would do to the intervals."""

    name: str  # ``"C/20 discharge"``.
    protocol: StepProtocol  # Its cycles of steps, from a fully charged cell.
    hours: float  # How long the fitted cell takes for it, h.
    worst: str  # The parameter that would then be known worst.
    worst_share_of_range: float  # Half the width of its interval, as a share of the range.
    shares_of_range: Mapping[str, float]  # The same for every parameter.


def suggestions(
    task: Task,
    best: Trial,
    jacobian: FloatArray,
    noise: float,
    now: Mapping[str, float],
    plugins: Simulating,
    spent: Spent,
) -> tuple[tuple[Suggestion, ...], int]:
    """Forecasts for the simulator's other protocols, or how many simulations the budget lacks for them.

    What the records fix already is taken as known: a protocol is simulated only along the directions that
    they leave open, which needs a few simulations instead of one for every parameter.
    """
    directions = open_directions(jacobian, noise)[:_MOST_DIRECTIONS]
    protocols = plugins.next_protocols() if len(directions) else {}
    if not protocols:
        return (), 0
    wanted, left = (1 + len(directions)) * len(protocols), max(spent.left, 0) + spent.unused
    if wanted > left:
        return (), wanted - left
    temperature = task.experiments[0].temperature_k
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiments = tuple(
        Experiment(name, nothing, protocol, None, temperature, _FULL) for name, protocol in protocols.items()
    )
    space = task.space
    points = [beside(space, best.candidate, direction, _ALONG) for direction in directions]
    candidates = [dict(best.candidate), *(space.from_unit(point) for point in points)]
    outcomes = plugins.simulate_variant(candidates, experiments)
    if outcomes is None:
        return (), 0
    here, *around = spent.counted(outcomes, len(experiments))
    moved = np.array(points) - space.to_unit(best.candidate)
    rows: dict[str, FloatArray] = {}
    hours: dict[str, float] = {}
    for place, experiment in enumerate(experiments):
        run = here.runs[place]
        if run.failure is not None or run.trajectory is None:
            continue
        alone = replace(task, experiments=(replace(experiment, target=run.trajectory),), held_out=())
        changes = [residuals(alone, Outcome((outcome.runs[place],))) for outcome in around]
        if any(change is None for change in changes):
            continue
        # The smallest matrix that maps the steps taken to the changes seen.
        rows[experiment.name] = np.array(changes).T @ np.linalg.pinv(moved.T)
        hours[experiment.name] = run.trajectory.duration / SECONDS_PER_HOUR
    found = []
    for name, shares in what_to_measure_next(jacobian, rows, now, noise).items():
        worst = max(shares, key=lambda parameter: shares[parameter])
        found.append(Suggestion(name, protocols[name], hours[name], worst, shares[worst], shares))
    return tuple(found), 0


def what_to_measure_next(
    jacobian: FloatArray, candidates: Mapping[str, FloatArray], now: Mapping[str, float], noise: float
) -> dict[str, dict[str, float]]:
    """Half the width that each interval would have, by protocol: first that with the narrowest widest one (minimax).

    Widths are shares of the range; among equals the smaller mean width decides.

    Parameters
    ----------
    jacobian : ndarray of shape (m, p)
        Derivatives of the residuals of what was measured, in the unit box.
    candidates : mapping of str to ndarray of shape (k, p)
        For each protocol the derivatives of its residuals, in the same tolerances.
    now : mapping of str to float
        Half the width of each parameter's present interval, in the order of the derivatives. That of a sample may be
        wider or narrower than a linear one: the linear model tells by what factor a further record narrows it.
    noise : float
        Standard deviation of the residuals, in tolerances (`Identifiability.noise`).

    References
    ----------
    Pukelsheim, Optimal Design of Experiments (2006), Ch. 6.
    """
    forecasts: dict[str, dict[str, float]] = {}
    before = np.sqrt(np.diag(covariance_of(jacobian, noise)))
    for protocol, rows in candidates.items():
        after = np.sqrt(np.diag(covariance_of(np.vstack([jacobian, rows]), noise)))
        forecasts[protocol] = {
            name: share * ratio for (name, share), ratio in zip(now.items(), after / before, strict=True)
        }
    widths = {protocol: (max(shares.values()), sum(shares.values())) for protocol, shares in forecasts.items()}
    return {protocol: forecasts[protocol] for protocol in sorted(forecasts, key=lambda protocol: widths[protocol])}
