"""The simulator of a discovery over a life: the whole of it, or one of its cycles alone."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ....core.ageing.summary import in_sequence
from ....core.comparison.residuals import residuals
from ....core.contracts.requests import LifeRequest, LifeResiduals
from ....core.errors import BsaError
from ....core.simulation import Outcome
from ....core.target import target_named
from ....core.task import Task
from ..solving.long_experiment import LongExperiment
from .request_pool import RequestPool, RequestService

_SECONDS_A_CYCLE, _LEAST_S = 1.5, 120.0
"""Longest time for a life, by its cycles, s: as the simulator of a calibration allows."""

_KEPT = 3
"""Compiled models that are kept: a fit asks for one of them again and again, and each is large."""


class LifeSimulator:
    """Simulates one request after the other; see `Answering`.

    The task is one life, whose space names the cell's own parameters.
    """

    at_once = 1
    has_low_fidelity = False
    recalled = 0

    def __init__(self, task: Task) -> None:
        self._task = task
        self._compiled: OrderedDict[tuple[bool, tuple[str, ...]], LongExperiment | None] = OrderedDict()
        self.simulations = 0
        self.refused: dict[str, str] = {}

    def predict(self, requests: Sequence[LifeRequest]) -> list[LifeResiduals | None]:
        """See `Answering.predict`."""
        return [self._predict(request) for request in requests]

    def _predict(self, request: LifeRequest) -> LifeResiduals | None:
        self.simulations += 1
        task = self._task if request.cycle is None else window(self._task, request.cycle)
        compiled = self._ready(task, request)
        if compiled is None:
            return None
        found = residuals(task, Outcome((compiled.solve(request.candidate),)))
        return None if found is None else LifeResiduals(found)

    def _ready(self, task: Task, request: LifeRequest) -> LongExperiment | None:
        """The compiled life with the effects, or the compiled window: one serves all cycles."""
        key = (request.cycle is None, tuple(effect.key for effect in request.effects))
        if key not in self._compiled:
            (experiment,), targets = task.experiments, dict(task.space.targets)
            if request.cycle is not None:
                experiment = replace(experiment, detailed_cycles=experiment.target.cycles)
                targets = {name: target_named(name) for name in request.candidate} | targets
            try:
                compiled = LongExperiment(task.cell, experiment, targets, effects=request.effects)
            except BsaError as error:
                if not request.effects:
                    raise
                self.refused[" + ".join(key[1])] = error.message
                compiled = None
            self._compiled[key] = compiled
            while len(self._compiled) > _KEPT:
                self._compiled.popitem(last=False)
        self._compiled.move_to_end(key)
        return self._compiled[key]


def window(task: Task, cycle: int) -> Task:
    """The task of one cycle of a life, simulated as its second: the cycle before brings the cell to where it begins."""
    (experiment,) = task.experiments
    assert experiment.protocol is not None
    alone = replace(
        experiment,
        target=in_sequence([(2, experiment.target.cycle(cycle))]),
        protocol=experiment.protocol[:1] * 2,
        detailed_cycles=(),
        scored_cycle=2,
    )
    return replace(task, experiments=(alone,))


class LifeSimulatorPool(RequestPool[LifeRequest, LifeResiduals]):
    """Simulates a life in worker processes; see `Answering` and `LifeSimulator`."""

    def __init__(self, task: Task, workers: int) -> None:
        cycles = len(task.experiments[0].protocol or ())
        limit_s = max(_LEAST_S, _SECONDS_A_CYCLE * cycles)
        super().__init__(RequestService(partial(LifeSimulator, task)), workers, limit_s)
