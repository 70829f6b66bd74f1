"""Feedback as a number, or as the paper's structured package (Sec. 3.2, step 1)."""

from typing import Any

from ...core.feedback import Feedback
from ...core.hooks import NoOptions, RunContext, hookimpl
from ...core.metrics import Metrics, objective_of, told_of
from ...core.signals import Signal
from ...core.simulation import Outcome
from ...core.task import Task
from ...core.trajectory import Trajectory
from .features import mismatches
from .rounding import rounded
from .steps import by_step

SUCCESS = "simulation_success"
"""The event of a simulation that ran to its end."""


def residuals_by_signal(task: Task, metrics: Metrics | None) -> dict[str, float]:
    """The residuals taken apart, so that a cause can be told from its effect."""
    shown = {quantity.told: quantity.shown(metrics) for quantity in told_of(task)}
    return {name: value for name, value in shown.items() if value is not None}


def events(task: Task, outcome: Outcome) -> list[str]:
    """What happened, in words; for a failure how far it got and how it ended."""
    lines: list[str] = []
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        lines += run.limits
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
                f"reached {run.trajectory.duration:.6g} s ({share:.0f} % of the record), last "
                f"{_last_values(task, run.trajectory)}"
            )
    return lines if outcome.failure else [SUCCESS, *lines]


def _last_values(task: Task, trajectory: Trajectory) -> str:
    """``"voltage 3.213 V at 1 A"``: the observed signals, and what was driven then."""

    def last(signal: Signal) -> str:
        return signal.printed(float(trajectory.values(signal.name)[-1]))

    observed = ", ".join(f"{signal.words} {last(signal)}" for signal in task.observed_in(trajectory))
    driven = ", ".join(last(signal) for signal in task.driven if signal.name in trajectory.signals)
    return f"{observed} at {driven}" if driven else observed


class ScalarFeedback:
    """The total error and nothing else."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._task = context.task

    @hookimpl
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        status = [SUCCESS] if outcome.ok else ["simulation_failed"]
        objective = objective_of(self._task).told  # Its name, which carries its unit.
        residuals = {objective: metrics.objective} if outcome.ok and metrics is not None else {}
        return Feedback(rounded({"residuals": residuals, "events": status}))


class StructuredFeedback:
    """Residuals by signal, features and residuals by step, events."""

    def __init__(self, options: Any, context: RunContext) -> None:
        self._task = context.task

    @hookimpl
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        found = mismatches(self._task, outcome)
        return Feedback(
            rounded(
                {
                    "residuals": residuals_by_signal(self._task, metrics if outcome.ok else None),
                    "features": {name: mismatch.value for name, mismatch in found.items()},
                    "tolerances": {name: mismatch.tolerance for name, mismatch in found.items()},
                    **by_step(self._task, outcome),
                    "events": events(self._task, outcome),
                }
            )
        )
