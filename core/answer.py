"""Which simulation a run reports, with its parameters and intervals."""

from collections.abc import Sequence

from .residuals import noise_of_residuals, rms
from .task import Task
from .trial import Trial, likeliest, promise

CLEARLY_ABOVE = 1.5
"""Misfit in units of the noise from which noise alone does not explain it: of a hundred residuals none comes near."""


def answer(task: Task, trials: Sequence[Trial]) -> Trial:
    """The trial that a run reports: the likeliest; the first one where none ran to its end.

    Under a protocol, a model that does not come down to the noise cannot have both the durations of the steps and the
    curves along them, and what the misfit counts point by point is no likelihood: a charge that is cut short, with
    every point after it on another clock, may have the least. The trial is then the one whose misfit and score are
    both low.
    """
    best = likeliest(trials)
    if task.given_drive or task.long or task.domain.metric != "paper":
        return best
    near = best.misfit <= CLEARLY_ABOVE * rms(noise_of_residuals(task))
    return best if near else min(trials, key=lambda trial: (promise(trial), trial.objective))
