"""Which errors a task is judged by, and how they are called: one choice, made by the task's domain."""

from collections.abc import Callable, Mapping
from typing import Any

from .ageing import metrics as ageing
from .ageing.metrics import AgeingMetrics
from .comparison import paper_metrics as paper
from .comparison.paper_metrics import PaperMetrics
from .comparison.signal_metrics import MISFIT, Metrics, Quantity, SignalMetrics, evaluate_signals, signal_errors
from .shape import shaped
from .simulation import Outcome
from .task import Task

__all__ = [
    "AgeingMetrics",
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
    # Under a measured current only the voltage is left of the paper's metric: too little where more was observed. Of a
    # spectrum nothing is left.
    more = (task.given_drive and len(task.observed) > 1) or any(e.is_spectrum for e in task.experiments)
    return task.domain.metric == "paper" and not more


def evaluate(task: Task, outcome: Outcome) -> Metrics | None:
    """Compare an outcome with the task's targets. None if an experiment failed before the part that is scored."""
    if not _by_paper(task):
        return evaluate_signals(task, outcome)
    return ageing.evaluate(task, outcome) if task.long else paper.evaluate(task, outcome)


def decode_metrics(content: Mapping[str, Any] | None) -> Metrics | None:
    """The inverse of `Metrics.as_json`."""
    if content is None:
        return None
    if "mape" in content:
        metrics: PaperMetrics = shaped(AgeingMetrics if "fade_error" in content else PaperMetrics, content)
        return metrics
    return SignalMetrics.from_json(shaped(dict[str, float], content))


def objective_of(task: Task) -> Quantity:
    """The error that "best" means."""
    return paper.objective_of(task) if _by_paper(task) else MISFIT


def headline_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that are shown first."""
    return _quantities(paper.headline_of, task)


def errors_of(task: Task) -> tuple[Quantity, ...]:
    """All errors, for a table."""
    return _quantities(paper.errors_of, task)


def told_of(task: Task) -> tuple[Quantity, ...]:
    """The errors that a proposer is told."""
    return _quantities(paper.told_of, task)


def _quantities(of_paper: Callable[[Task], tuple[Quantity, ...]], task: Task) -> tuple[Quantity, ...]:
    """The paper's errors, those of a life beside them; or where its own do not apply, those of the signals."""
    if not _by_paper(task):
        return (MISFIT, *signal_errors(task))
    found = of_paper(task)
    return (*ageing.over_cycles(found, task), *ageing.of_tables(task)) if task.long else found
