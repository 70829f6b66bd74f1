"""Which simulation a run reports, with its parameters and intervals."""

from collections.abc import Sequence

import numpy as np

from ..comparison.residuals import noise_of_residuals
from ..offered_effects import added_parameters
from ..prior import Prior
from ..rms import rms
from ..task import Task
from ..trial import Trial, likeliest, misfit_times_score

CLEARLY_ABOVE = 1.5
"""Misfit, in units of the noise, above which noise alone does not explain it.

The misfit of a true model with 100 independent residuals is 1.0 ± 0.07 times the noise.
"""

FINEST_NOISE = 1.0
"""Standard deviation of a residual that is assumed at least, in tolerances: a good cycler's millivolt."""


def answer(task: Task, trials: Sequence[Trial]) -> Trial:
    """The trial that a run reports: the most probable one; the first one where none ran to its end.

    Under a measured current that is the one with the highest posterior density. Under a protocol it is the likeliest.
    A simulated protocol that stays clearly above the noise is another case: the squared residuals are then no
    likelihood. A charge that is cut short may have the least sum of them, although every later point is at the wrong
    time. There the trial with the least product of misfit and score is reported.
    """
    if task.given_drive:
        return most_probable(task, trials)
    best = likeliest(trials)
    if not weighs_score(task, best):
        return best
    return min(trials, key=lambda trial: (misfit_times_score(trial), trial.objective))


def most_probable(task: Task, trials: Sequence[Trial]) -> Trial:
    """The trial with the highest posterior density, the parameters of effects that the search has added counted."""
    prior = Prior.of(task.space)
    return min(trials, key=lambda trial: (_improbability(task, prior, trial), trial.objective))


def _improbability(task: Task, prior: Prior, trial: Trial) -> float:
    """Minus twice the logarithm of the posterior density, but for a constant; infinite for a trial that failed.

    The standard deviation of the residuals is not known: it is the likeliest one. Each parameter of an effect that the
    search has added counts the logarithm of the number of residuals: a model with more parameters comes nearer in any
    case (Bayesian information criterion, doi:10.1214/aos/1176344136).
    """
    if trial.residuals is None:
        return np.inf
    departure = prior.deviations(task.space.to_unit(trial.candidate))
    noise, count = max(trial.misfit, FINEST_NOISE), len(trial.residuals)
    of_misfit = count * (2.0 * np.log(noise) + (trial.misfit / noise) ** 2)
    return float(of_misfit + departure @ departure + len(added_parameters(task, trial.candidate)) * np.log(count))


def weighs_score(task: Task, best: Trial) -> bool:
    """Whether the `answer` is the least product of misfit and score: ``best``, the answer or the likeliest, tells."""
    if task.given_drive or task.long or task.domain.metric != "paper":
        return False
    return best.misfit > CLEARLY_ABOVE * rms(noise_of_residuals(task))
