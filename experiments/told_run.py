"""A run that is part of longer work, told to whoever follows that work in lines of text."""

from collections.abc import Callable

from ..core.messages import Usage
from ..core.metrics import objective_of
from ..core.run.listener import Listener
from ..core.task import Task
from ..core.trial import Trial

_EVERY = 10
"""Simulations from line to line."""


class ToldRun(Listener):
    """The listener of a run; ``say`` is told now and then how many of its ``simulations`` are made, and the best error.

    What the run notes stands in its own journal and report.
    """

    def __init__(self, task: Task, simulations: int, say: Callable[[str], None]) -> None:
        self._unit = objective_of(task).of_unit
        self._simulations, self._say = simulations, say

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """See `Listener.tried`."""
        made = trial.index + 1
        if made % _EVERY == 0:
            error = f": {best.objective:.3g} {self._unit}" if best.ok else ""
            self._say(f"  {made} of {self._simulations} simulations at most{error}")
