"""Two ways to a cell that can be simulated: lower the currents and raise them again, or fit the first cycles alone.

Continuation, as in Allgower & Georg, Introduction to Numerical Continuation Methods (1990), Ch. 2: a problem that can
be solved is changed step by step into the wanted one. Every reduced simulation counts as one of the run's.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from ...core.inference.least_squares import LeastSquares
from ...core.parameters import Candidate, ParameterSpace
from ...core.task_reduction import TaskReduction
from ...core.trajectory import FloatArray, Step, StepKind, Trajectory
from ...core.trial import Trial

Reductions = tuple[TaskReduction | None, ...]

LOWERED = (0.5, 0.25)
"""Shares of the currents that are tried where the cell cannot be simulated at all of them."""

_NEARLY_WHOLE = 0.9
"""Share of the currents above which the task is simulated as it is."""

_DIFFERENCE = 0.05
"""Finite-difference step for the gentle direction, in units of the box: its length does not matter."""

_STRIDE = 0.15
"""Step along the gentle direction, in units of the box."""

_MOST_ROUNDS = 6
"""Steps along it after which a way back to the whole task is given up."""

_FIT_BEYOND_JACOBIAN = 8
"""Simulations that a fit of the first cycles may take beyond its start and a Jacobian."""

_ONSET = 0.2
"""First part of a step, over which polarisation is measured: later the state of charge decides the voltage."""

_ONSET_POINTS = 20
"""Times in that part at which the voltage is averaged."""


class Continuation(ABC):
    """Asks for candidates, some of them reduced, until one runs as the task is."""

    def __init__(self) -> None:
        self.reductions: Reductions = ()  # How the task is reduced for each of the candidates just asked for.
        self.over = False  # Whether nothing more is to come.

    @property
    @abstractmethod
    def words(self) -> str:
        """What is being tried, in a sentence."""

    @abstractmethod
    def ask(self, limit: int) -> list[Candidate]:
        """What to simulate next; empty when it is over or cannot go on within the limit."""

    @abstractmethod
    def tell(self, trials: Sequence[Trial]) -> None:
        """Take in the trials of the candidates asked for, in order."""


class CurrentRateContinuation(Continuation):
    """Lowers the currents until the cell can be simulated, and raises them again in a cell with less polarisation.

    The direction towards less polarisation is measured at the lowered currents: along it the voltage changes less at
    the onset of a constant current. ``start``, shape (p,), is the point that fails, in the unit box; ``gentle``, shape
    (p,), the direction to take where none can be measured; ``rates`` are the shares of the currents to try, largest
    first.
    """

    def __init__(
        self, space: ParameterSpace, start: FloatArray, gentle: FloatArray, rates: tuple[float, ...] = LOWERED
    ) -> None:
        super().__init__()
        self._space = space
        self._point = np.clip(start, 0.0, 1.0)
        self._gentle = gentle
        self._rates = list(rates)
        self._rate, self._next_rate = 0.0, 0.0
        self._direction: FloatArray | None = None
        self._base: Trial | None = None
        self._rounds = 0
        self._batch: list[FloatArray] = []

    @property
    def words(self) -> str:
        """See `Continuation.words`."""
        if self._rate == 0.0:
            return "Nothing runs at the task's own currents: lower ones first."
        runs = f"The cell runs at {100 * self._rate:.3g} % of the currents"
        if self._direction is None:
            return f"{runs}: looking for the parameters that let it run at more."
        return f"{runs}: back towards all of them, with those parameters changed."

    def ask(self, limit: int) -> list[Candidate]:
        """See `Continuation.ask`."""
        if self.over or limit <= 0:
            return []
        if self._rate == 0.0:
            self._batch, self.reductions = [self._point], (TaskReduction(self._rates[0]),)
        elif self._direction is None and limit >= len(self._space):
            self._batch = [self._beside(place) for place in range(len(self._space))]
            self.reductions = (TaskReduction(self._rate),) * len(self._batch)
        else:
            if self._direction is None:
                self._direction = self._gentle
            if not np.any(self._direction):
                self.over = True
                return []
            reduction = None if self._next_rate == 1.0 else TaskReduction(self._next_rate)
            self._batch = [self._along(1), self._along(2)][: max(limit, 1)]
            self.reductions = (reduction, None)[: len(self._batch)]
        return [self._space.from_unit(point) for point in self._batch]

    def tell(self, trials: Sequence[Trial]) -> None:
        """See `Continuation.tell`."""
        if len(trials) < len(self._batch) or not trials:
            self.over = True
        elif self._rate == 0.0:
            self._take_lowered(trials[0])
        elif self._direction is None:
            self._take_slopes(trials)
        else:
            self._take_climb(trials)

    def _take_lowered(self, trial: Trial) -> None:
        rate = self._rates.pop(0)
        if not trial.failed:
            self._base = trial
            self._rate, self._next_rate = rate, _towards_one(rate)
        elif not self._rates:
            self.over = True

    def _take_slopes(self, trials: Sequence[Trial]) -> None:
        assert self._base is not None
        slopes = np.zeros(len(self._space))
        for place, (point, trial) in enumerate(zip(self._batch, trials, strict=True)):
            change = point[place] - self._point[place]
            if not trial.failed and change != 0.0:
                slopes[place] = -_more_polarised(trial, self._base) / change
        strongest = float(np.max(np.abs(slopes)))
        for place, (point, trial) in enumerate(zip(self._batch, trials, strict=True)):
            if trial.failed:
                # A neighbour that does not even run at this rate lies on the wrong side.
                slopes[place] = -np.sign(point[place] - self._point[place]) * (strongest or 1.0)
        strongest = float(np.max(np.abs(slopes)))
        self._direction = slopes / strongest if strongest > 0 else self._gentle

    def _take_climb(self, trials: Sequence[Trial]) -> None:
        self._rounds += 1
        if _found_by(trials):
            self.over = True
            return
        runs = not trials[0].failed
        self._point = self._along(1)
        if runs:
            self._rate, self._next_rate = self._next_rate, _towards_one(self._next_rate)
        else:
            self._next_rate = float(np.sqrt(self._rate * self._next_rate))
        self.over = self._rounds >= _MOST_ROUNDS

    def _along(self, strides: int) -> FloatArray:
        assert self._direction is not None
        return np.clip(self._point + strides * _STRIDE * self._direction, 0.0, 1.0)

    def _beside(self, place: int) -> FloatArray:
        point = self._point.copy()
        point[place] += _DIFFERENCE if point[place] <= 0.5 else -_DIFFERENCE
        return point


def _towards_one(rate: float) -> float:
    """Half of the way to the full rate, in powers of it."""
    higher = float(np.sqrt(rate))
    return 1.0 if higher > _NEARLY_WHOLE else higher


def _more_polarised(trial: Trial, base: Trial) -> float:
    """Logarithm of a trial's polarisation over another's, each constant-current step on the other's clock."""
    ours, theirs = 0.0, 0.0
    for curve, other in zip(trial.curves, base.curves, strict=True):
        if curve is None or other is None:
            continue
        found = {(step.cycle, step.position): step for step in curve.steps}
        for step in other.steps:
            same = found.get((step.cycle, step.position))
            if same is None or step.kind not in (StepKind.CC_CHARGE, StepKind.CC_DISCHARGE):
                continue
            horizon_s = _ONSET * (other.time[step.stop - 1] - other.time[step.start])
            if horizon_s > 0:
                ours += _voltage_moved(curve, same, horizon_s)
                theirs += _voltage_moved(other, step, horizon_s)
    return float(np.log(ours / theirs)) if ours > 0 and theirs > 0 else 0.0


def _voltage_moved(curve: Trajectory, step: Step, horizon_s: float) -> float:
    """How far the voltage moves from where it was before a step, on average over the step's beginning, V."""
    time = curve.time[step.start : step.stop] - curve.time[step.start]
    voltage = curve.voltage[step.start : step.stop]
    before = curve.voltage[max(step.start - 1, 0)]
    return float(np.mean(np.abs(np.interp(np.linspace(0.0, horizon_s, _ONSET_POINTS), time, voltage) - before)))


class FirstCycleContinuation(Continuation):
    """Fits the record's first cycles alone, which run, and tries the whole task from every better point.

    It begins at ``start``, shape (p,), in the unit box; by default as many simulations are allowed as a Jacobian and
    some steps take.
    """

    def __init__(self, space: ParameterSpace, start: FloatArray, cycles: int, allowance: int | None = None) -> None:
        super().__init__()
        self._space = space
        self._reduction = TaskReduction(cycles=cycles)
        self._left = allowance or len(space) + _FIT_BEYOND_JACOBIAN
        self._search = LeastSquares(start)
        self._tried = np.asarray(start, dtype=np.float64)

    @property
    def words(self) -> str:
        """See `Continuation.words`."""
        return f"The task ends early, but it has a beginning: fit {self._reduction.words}, then all of it."

    def ask(self, limit: int) -> list[Candidate]:
        """See `Continuation.ask`."""
        limit = min(limit, self._left)
        points = self._search.ask(limit) if not self.over and limit > 0 else []
        if len(points) > limit:
            points = []
        asked: list[TaskReduction | None] = [self._reduction] * len(points)
        better = not np.array_equal(self._search.point, self._tried)
        # A better point of the first cycles is tried on all of them beside the next step.
        if better and len(points) < limit and len(points) <= 1:
            points = [*points, self._search.point]
            asked.append(None)
        self.reductions = tuple(asked)
        self.over = self.over or not points
        return [self._space.from_unit(point) for point in points]

    def tell(self, trials: Sequence[Trial]) -> None:
        """See `Continuation.tell`."""
        if not trials or len(trials) < len(self.reductions):
            self.over = True
            return
        self._left -= len(trials)
        whole = [trial for trial in trials if trial.reduction is None]
        if whole:
            self._tried = self._search.point
        reduced = [trial for trial in trials if trial.reduction is not None]
        if reduced:
            self._search.tell([_of_its_cycles(trial) for trial in reduced])
        self.over = self.over or _found_by(trials)


def _found_by(trials: Sequence[Trial]) -> bool:
    """Whether one of the trials ran to its end, of the task as it is."""
    return any(trial.reduction is None and trial.residuals is not None for trial in trials)


def _of_its_cycles(trial: Trial) -> FloatArray | None:
    """The residuals of the first cycles, of which the trial was alone; None where it failed."""
    return None if trial.failed or trial.partial is None else trial.partial[np.isfinite(trial.partial)]
