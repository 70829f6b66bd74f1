"""The misfit of a search, beside the errors of its start and of its answer: what the fit minimises."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...core.comparison.signal_metrics import MISFIT, Quantity
from ...core.metrics import errors_of
from ...core.task import Task
from ...core.trial import Trial

SEARCH_MISFIT = Quantity("misfit", "RMS misfit in the search", MISFIT.unit)


def search_misfits(task: Task, initial: Trial, best: Trial) -> Mapping[Quantity, tuple[float | None, float | None]]:
    """The misfit of both, in tolerances, None for one that has none; empty where it is among the task's errors."""
    if MISFIT in errors_of(task):
        return {}
    before, after = (trial.misfit if math.isfinite(trial.misfit) else None for trial in (initial, best))
    return {SEARCH_MISFIT: (before, after)}
