"""Feedback as a number, or as the paper's structured package (Sec. 3.2, step 1)."""

from __future__ import annotations

from typing import Any

from ...core.feedback import Feedback
from ...core.hooks import NoOptions, RunContext, hookimpl
from ...core.metrics import Metrics
from ...core.simulation import Outcome
from ...core.task import Task
from .features import features
from .rounding import rounded


def scalar_residuals(metrics: Metrics | None) -> dict[str, float]:
    """The one number a blind optimiser would see, by a name that carries its unit."""
    if metrics is None:
        return {}
    if metrics.objective == metrics.v_rmse_mv:
        return {"voltage_rmse_mv": metrics.v_rmse_mv}
    return {"total_mape_pct": metrics.mape}


def residuals_by_signal(metrics: Metrics | None) -> dict[str, float]:
    """The residuals taken apart, so that a cause can be told from its effect."""
    if metrics is None:
        return {}
    return {
        "total_mape_pct": metrics.mape,
        "capacity_mape_pct": metrics.q_mape,
        "current_mape_pct": metrics.i_mape,
        "voltage_mape_pct": metrics.v_mape,
        "voltage_rmse_mv": metrics.v_rmse_mv,
        "discharged_capacity_error_pct": 100.0 * metrics.capacity_error,
    }


def events(task: Task, outcome: Outcome) -> list[str]:
    """What happened, in words; for a failure how far it got and how it ended."""
    lines: list[str] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        failure = run.failure
        if failure is None:
            continue
        lines.append(f"simulation_failed: {failure.cause}")
        if failure.step:
            lines.append(f"stopped in cycle {failure.cycle} during: {failure.step}")
        if failure.limit:
            lines.append(f"at that moment: {failure.limit}")
        if run.trajectory is not None:
            share = 100.0 * run.trajectory.duration / max(experiment.target.duration, 1e-9)
            lines.append(
                f"reached {run.trajectory.duration:.0f} s ({share:.0f} % of the record), last voltage "
                f"{run.trajectory.voltage[-1]:.3f} V at {run.trajectory.current[-1]:.3g} A"
            )
    return lines or ["simulation_success"]


class ScalarFeedback:
    """The total error and nothing else."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._task = context.task

    @hookimpl
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        status = ["simulation_success"] if outcome.ok else ["simulation_failed"]
        return Feedback(rounded({"residuals": scalar_residuals(metrics if outcome.ok else None), "events": status}))


class StructuredFeedback:
    """Residuals by signal, features by step, events."""

    def __init__(self, options: Any, context: RunContext) -> None:
        self._task = context.task

    @hookimpl
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        return Feedback(
            rounded(
                {
                    "residuals": residuals_by_signal(metrics if outcome.ok else None),
                    "features": features(self._task, outcome),
                    "events": events(self._task, outcome),
                }
            )
        )
