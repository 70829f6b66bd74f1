"""What optimisers are told of past trials: numbers, failed simulations included."""

from collections.abc import Callable, Sequence

import numpy as np

from ...core.hooks import ProposeContext
from ...core.trajectory import FloatArray
from ...core.trial import Trial

ALL_WRONG = 300.0
"""Total MAPE, in percent, of a record that is zero throughout: 100 for each of charge, current and voltage."""


def sum_of_squares(trial: Trial) -> float:
    """What least squares minimise; infinite where the trial has no residuals."""
    return float("inf") if trial.residuals is None else float(trial.residuals @ trial.residuals)


def finite_errors(trials: Sequence[Trial], error: Callable[[Trial], float]) -> FloatArray:
    """The errors of trials, shape (n,); a failed one counts as twice the worst that did not fail.

    An infinite error would stop a surrogate or a ranking; an enormous one would flatten everything else. ``error`` is
    what is minimised, infinite for a failed trial.
    """
    values = np.array([error(trial) if trial.ok else np.inf for trial in trials])
    known = values[np.isfinite(values)]
    worst = float(known.max()) if known.size else 0.0
    return np.where(np.isfinite(values), values, 2.0 * max(worst, ALL_WRONG))


def errors_by_round(
    context: ProposeContext, error: Callable[[Trial], float] = lambda trial: trial.objective
) -> list[FloatArray]:
    """The errors of the search so far (`finite_errors`), an array a round; without start and warm-up."""
    trials = [trial for trial in context.trials if trial.phase == "search"]
    if not trials:
        return []
    _, begins = np.unique([trial.round for trial in trials], return_index=True)
    return np.split(finite_errors(trials, error), begins[1:])
