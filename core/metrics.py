"""Which errors a task is judged by, and how they are called: one choice, made by the task's domain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from . import paper_metrics as paper
from .paper_metrics import PaperMetrics
from .shape import shaped
from .signal_metrics import MISFIT, Metrics, Quantity, SignalMetrics, evaluate_signals, signal_errors
from .simulation import Outcome
from .task import Task

__all__ = [
    "Metrics",
    "PaperMetrics",
    "Quantity",
    "SignalMetrics",
    "decode_metrics",
    "errors_of",
    "evaluate",
    "headline_of",
    "objective_of",
    "told_of",
]


def _by_paper(task: Task) -> bool:
    return task.domain.metric == "paper"


def evaluate(task: Task, outcome: Outcome) -> Metrics | None:
    """Compare an outcome with the task's targets.

    Returns
    -------
    Metrics or None
        None if an experiment failed before the part that is scored.
    """
    return paper.evaluate(task, outcome) if _by_paper(task) else evaluate_signals(task, outcome)


def decode_metrics(content: Mapping[str, Any] | None) -> Metrics | None:
    """The inverse of `Metrics.as_json`."""
    if content is None:
        return None
    if "mape" in content:
        metrics: PaperMetrics = shaped(PaperMetrics, content)
        return metrics
    return SignalMetrics.from_json(shaped(dict[str, float], content))


def objective_of(task: Task) -> Quantity:
    """The error that "best" means."""
    return paper.objective_of(task) if _by_paper(task) else MISFIT


def headline_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that are shown first."""
    return paper.headline_of(task) if _by_paper(task) else (MISFIT, *signal_errors(task))


def errors_of(task: Task) -> tuple[Quantity, ...]:
    """All errors, for a table."""
    return paper.errors_of(task) if _by_paper(task) else (MISFIT, *signal_errors(task))


def told_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that a proposer is told."""
    return paper.TOLD if _by_paper(task) else (MISFIT, *signal_errors(task))
