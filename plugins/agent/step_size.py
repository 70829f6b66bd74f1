"""The adaptive step size η_t of the update rule (paper, Eq. 4)."""

from __future__ import annotations

from collections.abc import Sequence

from ...core.trial import Trial

_SMALLEST = 0.1
_SHRINK, _GROW = 0.5, 1.5


def step_size(trials: Sequence[Trial]) -> float:
    """The share of the next change to apply: less after changes that made it worse, more after better ones.

    A function of the trials alone, so that it survives a resume.
    """
    share, best = 1.0, float("inf")
    for trial in trials:
        if trial.phase == "search":
            share = min(1.0, share * _GROW) if trial.objective < best else max(_SMALLEST, share * _SHRINK)
        best = min(best, trial.objective)
    return share
