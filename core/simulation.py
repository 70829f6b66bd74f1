"""What comes back when a candidate is simulated, whole or in part."""

from collections.abc import Iterable
from dataclasses import dataclass

from .trajectory import Trajectory


@dataclass(frozen=True)
class SimulationFailure:
    """Why a simulation stopped early.

    Attributes
    ----------
    cause : str
        The reason in one line: the solver's words, the event, or the time limit.
    step : str
        The protocol step it died in, for example ``"Charge at 2C until 4.2 V"``; empty if it never started.
    cycle : int
        The cycle of that step, counted from 1; 0 if it never started.
    reached_s : float
        Seconds of simulated time before the end.
    limit : str
        Which physical limit was near when it stopped, in plain words (a surface empty of lithium, an
        electrolyte without salt); empty where the simulator cannot tell.
    unfinished : bool
        Whether the last step of the trajectory is the one it died in, cut short; else all of them are whole.
    """

    cause: str
    step: str = ""
    cycle: int = 0
    reached_s: float = 0.0
    limit: str = ""
    unfinished: bool = False


@dataclass(frozen=True)
class ExperimentRun:
    """The simulation of one experiment of a task.

    Attributes
    ----------
    trajectory : Trajectory or None
        What was reached; None if nothing was.
    failure : SimulationFailure or None
        Set when the trajectory is partial or missing.
    limits : tuple of str
        Limits that the simulation ran into and went on from, in plain words (``"the simulated cell was empty at
        3,120 s of 3,600 s"``): what it shows from then on says how wrong it is, and nothing else.
    at_limit : tuple of (float, float)
        From when to when it stood at such a limit, s since its first sample.
    """

    trajectory: Trajectory | None
    failure: SimulationFailure | None = None
    limits: tuple[str, ...] = ()
    at_limit: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Outcome:
    """The simulation of a candidate: one run for each experiment of the task, in the task's order.

    Attributes
    ----------
    runs : tuple of ExperimentRun
        One for each experiment.
    seconds : float
        Wall time spent in the simulator.
    """

    runs: tuple[ExperimentRun, ...]
    seconds: float = 0.0

    @property
    def failure(self) -> SimulationFailure | None:
        """The first failure, or None if every experiment ran to its end."""
        return next((run.failure for run in self.runs if run.failure), None)

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits that any experiment ran into and went on from."""
        return tuple(limit for run in self.runs for limit in run.limits)

    @property
    def ok(self) -> bool:
        """Whether every experiment ran to its end."""
        return self.failure is None


def in_order(pairs: Iterable[tuple[int, Outcome]]) -> list[Outcome]:
    """The outcomes in the order of their places; simulations side by side finish in any."""
    return [outcome for _, outcome in sorted(pairs, key=lambda pair: pair[0])]
