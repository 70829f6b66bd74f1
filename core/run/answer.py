"""Which simulation a run reports, with its parameters and intervals."""

from collections.abc import Sequence

from ..comparison.residuals import noise_of_residuals
from ..rms import rms
from ..task import Task
from ..trial import Trial, likeliest, misfit_times_score

CLEARLY_ABOVE = 1.5
"""Misfit, in units of the noise, above which noise alone does not explain it.

The misfit of a true model with 100 independent residuals is 1.0 ± 0.07 times the noise.
"""


def answer(task: Task, trials: Sequence[Trial]) -> Trial:
    """The trial that a run reports: the likeliest; the first one where none ran to its end.

    A simulated protocol that stays clearly above the noise is another case: the squared residuals are then no
    likelihood. A charge that is cut short may have the least sum of them, although every later point is at the wrong
    time. There the trial with the least product of misfit and score is reported.
    """
    best = likeliest(trials)
    if not weighs_score(task, best):
        return best
    return min(trials, key=lambda trial: (misfit_times_score(trial), trial.objective))


def weighs_score(task: Task, best: Trial) -> bool:
    """Whether the `answer` is the least product of misfit and score: ``best``, the answer or the likeliest, tells."""
    if task.given_drive or task.long or task.domain.metric != "paper":
        return False
    return best.misfit > CLEARLY_ABOVE * rms(noise_of_residuals(task))
