"""A small task, and a cell solved on paper that simulates it in microseconds."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ..core.hooks import Entry, NoOptions, RunContext, hookimpl
from ..core.parameters import Candidate, Parameter, ParameterSpace
from ..core.segmentation import segment
from ..core.simulation import ExperimentRun, Outcome, SimulationFailure
from ..core.task import CellModel, Experiment, Task
from ..core.trajectory import SECONDS_PER_HOUR, Step, Trajectory

SAMPLE_SIMULATOR = "sample-cell"

_RESISTANCE, _CAPACITY = "Positive particle radius [m]", "Negative particle radius [m]"
"""Parameters of Chen2020, so that PyBaMM can simulate the task as well; here they act like these two."""

_SPACE = ParameterSpace(
    (Parameter(_RESISTANCE, 5.22e-6, 1.3e-6, 20.9e-6, "log"), Parameter(_CAPACITY, 5.86e-6, 1.5e-6, 23.4e-6, "log"))
)
_BREAKS_ABOVE = 3.0
"""Above this multiple of its initial resistance the cell fails, so that every search meets failures."""

_HIDDEN = {_RESISTANCE: 1.5 * _SPACE[_RESISTANCE].initial, _CAPACITY: 0.8 * _SPACE[_CAPACITY].initial}


def sample_task(simulator: str = SAMPLE_SIMULATOR) -> Task:
    """A rest of 60 s, a discharge at 2 A for 600 s and a rest of 240 s, driven by the current; two parameters.

    Parameters
    ----------
    simulator : str
        Which one the task is made for: by default a cell solved on paper. A battery model that takes the parameters
        of Chen2020 can simulate it as well.

    Returns
    -------
    Task
    """
    time = np.arange(0.0, 901.0, 10.0)
    current = np.where((time > 60.0) & (time <= 660.0), 2.0, 0.0)
    record = segment(_record(time, current, _HIDDEN))
    experiment = Experiment("sample record", record)
    return Task("sample", CellModel("Chen2020", "SPM"), _SPACE, (experiment,), simulator=simulator)


def _record(time: np.ndarray, current: np.ndarray, candidate: Candidate, steps: tuple[Step, ...] = ()) -> Trajectory:
    drawn = np.concatenate([[0.0], np.cumsum(np.diff(time) * current[1:])]) / SECONDS_PER_HOUR
    resistance = 0.03 * candidate[_RESISTANCE] / _SPACE[_RESISTANCE].initial
    slope = 0.3 * candidate[_CAPACITY] / _SPACE[_CAPACITY].initial
    return Trajectory(time, current, 4.1 - slope * drawn - resistance * current, steps=steps)


class SampleCell:
    """The simulator of the sample task."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._experiments = context.task.experiments

    @hookimpl
    def simulate(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        for place, candidate in enumerate(candidates):
            yield place, Outcome(tuple(self._run(candidate, experiment) for experiment in self._experiments), 1e-4)

    def _run(self, candidate: Candidate, experiment: Experiment) -> ExperimentRun:
        if candidate[_RESISTANCE] > _BREAKS_ABOVE * _SPACE[_RESISTANCE].initial:
            return ExperimentRun(None, SimulationFailure("the resistance is too large for this cell"))
        target = experiment.target
        return ExperimentRun(_record(target.time, target.current, candidate, target.steps))


@hookimpl
def bsa_simulators() -> Iterable[Entry]:
    """The cell of the sample task; registered while a conformance class runs."""
    yield Entry(SAMPLE_SIMULATOR, SampleCell, "A cell of two parameters, solved on paper.", api=1)
