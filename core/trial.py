"""One candidate and everything that is known of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .feedback import Feedback
from .metrics import Metrics
from .parameters import Candidate
from .simulation import SimulationFailure
from .trajectory import FloatArray, Trajectory

Phase = Literal["initial", "warm-up", "search"]


@dataclass(frozen=True, eq=False)
class Trial:
    """A simulated candidate.

    Attributes
    ----------
    index : int
        Number of the simulation in its run, from 0.
    phase : {'initial', 'warm-up', 'search'}
        When it was tried. The initial trial is the task's starting point.
    round : int
        The round of its phase, from 1 (0 for the initial trial).
    candidate : Candidate
        The parameter values.
    metrics : Metrics or None
        How well it matched; None if nothing could be compared.
    failure : SimulationFailure or None
        Set when a simulation stopped early.
    residuals : ndarray of shape (m,) or None
        Step-aligned residuals (see `residuals`), in units of their tolerance; None after a failure.
    feedback : Feedback
        What the proposer is told.
    curves : tuple of Trajectory or None
        The simulated records, thinned, one for each experiment.
    seconds : float
        Wall time in the simulator.
    """

    index: int
    phase: Phase
    round: int
    candidate: Candidate
    metrics: Metrics | None
    failure: SimulationFailure | None
    residuals: FloatArray | None
    feedback: Feedback
    curves: tuple[Trajectory | None, ...]
    seconds: float

    @property
    def ok(self) -> bool:
        """Whether the whole task was simulated."""
        return self.failure is None and self.metrics is not None

    @property
    def objective(self) -> float:
        """The number that "best" means: total MAPE, or infinity for a failed trial."""
        return self.metrics.objective if self.ok and self.metrics is not None else float("inf")
