"""How far a change may go, by what became of the earlier ones: the trust region of Nocedal & Wright (2006), Ch. 4."""

from __future__ import annotations

import math

import numpy as np

from .reading import Prompt

_LONGEST = 5.0
"""Typical steps, all parameters together, that one round may move."""

_GROWTH = 2.0
"""Times its length that a change which helped lets the next one have."""

_HOPELESS = 10.0
"""Times the misfit before from which no more is learnt of the length; also of a simulation that failed."""

_UNTOLD = 2.0
"""Times the misfit before, of a change of which is told only that it was no better."""

_LEAST = 0.02
"""Typical steps below which a change is lost in the rounding of the prompt."""

_SEARCHING = ("", "search", "agent")
"""Who asks for trials that are attempts at the record."""


def failed_in_a_row(prompt: Prompt) -> int:
    """How many changes tried from the present values were no better."""
    return len(_failed(prompt))


def trusted_length(prompt: Prompt) -> float:
    """The longest change, in typical steps, that the trials told in the prompt leave promising."""
    if any(math.isfinite(trial.misfit) for trial in prompt.trials):
        length = _followed(prompt)
    else:
        failed = [_share(_UNTOLD) * float(np.linalg.norm(steps)) for steps in _failed(prompt)]
        length = min(failed, default=_LONGEST)
    return min(max(length, _LEAST), _LONGEST)


def _failed(prompt: Prompt) -> list[tuple[float, ...]]:
    """The changes tried from the present values that were no better."""
    tried = {trial.index: trial.steps for trial in prompt.trials if trial.asked_by in _SEARCHING}
    failed = [steps for index, steps in tried.items() if index > prompt.present]
    return failed or ([prompt.attempt] if prompt.attempt else [])


def _followed(prompt: Prompt) -> float:
    """The length after the trials told, in their order."""
    first, *later = sorted(prompt.trials, key=lambda trial: trial.index)
    length, best = _LONGEST, first
    for trial in later:
        if trial.asked_by in _SEARCHING and math.isfinite(best.misfit):
            moved = float(np.linalg.norm(np.subtract(trial.steps, best.steps)))
            better = trial.misfit < best.misfit
            length = max(length, _GROWTH * moved) if better else min(length, _share(trial.misfit / best.misfit) * moved)
        best = min(best, trial, key=lambda one: one.misfit)
    return length


def _share(worse: float) -> float:
    """The share of a change that is best, if the effects hold but for a term that grows with its length squared.

    Parameters
    ----------
    worse : float
        Misfit after the whole change, relative to that before it.

    Notes
    -----
    After a share s of the change, (1 - s) of the mismatch is left and the term has grown to s^2 of what the whole left.
    Where the two are unlike, the sum of their squares is least at 2 worse^2 s^3 = 1 - s: 0.59 for 1, 0.16 for 10.
    """
    roots = np.roots([2.0 * min(worse, _HOPELESS) ** 2, 0.0, 1.0, -1.0])
    return float(next(root.real for root in roots if abs(root.imag) < 1e-9))
