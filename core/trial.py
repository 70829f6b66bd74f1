"""One candidate and everything that is known of it; and which of several is best, which depends on the purpose.

==================  ==========================================  ======================================================
Function            Best means                                  Used for
==================  ==========================================  ======================================================
`lowest`            the lowest objective (score)                searches, ``ProposeContext.best``, ``stop_below``,
                                                                benchmarks, ``best_score`` of ``result.json``
`likeliest`         the least misfit, step by step              what follows the record most closely
`closest`           `likeliest`, or `lowest` for a proposer     the trial from which a proposer goes on
                    that is shown the objective alone
`answer.answer`     the highest posterior density; under a      what a run reports: parameters, curves, intervals,
                    protocol `likeliest`, or far from the       predictions, ``best`` of ``result.json``
                    noise the least `misfit_times_score`
==================  ==========================================  ======================================================
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from .feedback import Feedback
from .metrics import Metrics
from .parameters import Candidate
from .rms import rms
from .simulation import SimulationFailure
from .task_reduction import TaskReduction
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
    reduction : TaskReduction or None
        How the task was reduced for this simulation; it then has no metrics and no residuals of the task.
    partial : ndarray of shape (k,) or None
        Of a trial that failed, and of one of the first cycles alone: residuals of all cycles (see
        `partial_residuals`), NaN for steps that it did not finish. None where there is no record to compare with, or
        nothing was reached.
    limits : tuple of str
        See `ExperimentRun.limits`.
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
    reduction: TaskReduction | None = None
    partial: FloatArray | None = None
    limits: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the whole task was simulated, as it is."""
        return self.failure is None and self.metrics is not None

    @property
    def failed(self) -> bool:
        """Whether the simulation did not run to its end, or showed nothing that can be compared."""
        return self.failure is not None or (self.metrics is None and self.reduction is None)

    @property
    def objective(self) -> float:
        """The number that "best" means, or infinity for a failed trial."""
        return self.metrics.objective if self.ok and self.metrics is not None else float("inf")

    @property
    def misfit(self) -> float:
        """Root mean square of the step-aligned residuals, in tolerances; infinite where there are none."""
        return rms(self.residuals)


def likeliest(trials: Sequence[Trial]) -> Trial:
    """The trial with the least misfit step by step.

    Of equal misfits the lowest objective decides; where no trial ran to its end, it is the first one. The objective is
    no likelihood: it may compare at equal times, where one step of the wrong duration shifts all steps after it.
    """
    return min(trials, key=lambda trial: (trial.misfit, trial.objective))


def lowest(trials: Sequence[Trial]) -> Trial:
    """The trial with the best score, which searches and benchmarks count by; the first one if none succeeded."""
    return min(trials, key=lambda trial: trial.objective)


def misfit_times_score(trial: Trial) -> float:
    """Misfit times objective, low where both are: one of them alone may be low because a step is missing."""
    return trial.misfit * trial.objective


def simulated_with(
    candidate: Candidate, trials: Iterable[Trial], reduction: TaskReduction | None = None
) -> Trial | None:
    """The first trial with these values, of the task as it is or reduced likewise; None where there is none."""
    values = dict(candidate)
    same = (trial for trial in trials if trial.reduction == reduction and dict(trial.candidate) == values)
    return next(same, None)


def repeated_by(trial: Trial, trials: Sequence[Trial]) -> Trial | None:
    """The first earlier trial with the same values of the same task; None where there is none."""
    return simulated_with(trial.candidate, (one for one in trials if one.index < trial.index), trial.reduction)


def closest(trials: Sequence[Trial]) -> Trial:
    """The trial from which a proposer goes on: the likeliest, or the lowest where it is shown the objective alone."""
    shown = any(trial.feedback.content.get("features") for trial in trials)
    return (likeliest if shown else lowest)(trials)
