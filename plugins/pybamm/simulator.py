"""The PyBaMM simulator plugin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pydantic import BaseModel, Field

from ...core.hooks import RunContext, hookimpl
from ...core.parameters import Candidate
from ...core.simulation import Outcome
from .worker import Assignment, WorkerPool


class PyBaMMOptions(BaseModel, extra="forbid"):
    """How PyBaMM is run."""

    time_limit_s: float = Field(30.0, gt=0, description="Longest time for one evaluation, in seconds.")


class PyBaMMSimulator:
    """Simulates a task's candidates in worker processes.

    Parameters
    ----------
    options : PyBaMMOptions
        Time limit.
    context : RunContext
        The task, and how many workers to use.
    """

    def __init__(self, options: PyBaMMOptions, context: RunContext) -> None:
        task = context.task
        self._task = task
        self._pool = WorkerPool(
            Assignment(task.cell, task.experiments, task.space.names), context.workers, options.time_limit_s
        )

    @hookimpl
    def simulate(
        self, candidates: Sequence[Candidate], exact: bool, report: Callable[[int, Outcome], None]
    ) -> list[Outcome]:
        """Simulate side by side; ``exact`` uses PyBaMM's standard mesh and tight tolerances."""
        return self._pool.simulate(candidates, exact, report)

    @hookimpl
    def export(self, candidate: Candidate) -> Mapping[str, str]:
        """A script that needs pybamm alone and reproduces the candidate's curves."""
        from .export import script

        return {"best_parameters.py": script(self._task, candidate)}

    @hookimpl
    def close(self) -> None:
        """End the worker processes."""
        self._pool.close()
