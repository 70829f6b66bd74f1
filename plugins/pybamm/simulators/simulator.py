"""The PyBaMM simulator plugin."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from pydantic import BaseModel, Field

from ....core.cell import CELL, SPECTRUM, TEMPERATURE
from ....core.errors import BsaError
from ....core.hooks import RunContext, hookimpl
from ....core.parameters import Candidate
from ....core.simulation import Outcome
from ....core.target import InitialSoc, Target
from ....core.task import Experiment, Protocol
from ....core.task_reduction import TaskReduction
from ..modelling.resolution import FINE, LOW_FIDELITY, REFERENCE, SEARCH
from .reduced import reduced
from .worker import CandidateService, WorkerPool

if TYPE_CHECKING:
    from ..solving.equilibrium import EquilibriumCell

_CYCLES_IN_THE_LIMIT = 20
"""Cycles for which the time limit is meant: a cycle of the slowest parameter set takes about a second."""

_SAMPLES_IN_THE_LIMIT = 10_000
"""Samples of measured currents for which it is meant: of a drive cycle every sample is a change of the current."""


class PyBaMMOptions(BaseModel, extra="forbid"):
    """How PyBaMM is run."""

    time_limit_s: float = Field(
        30.0,
        gt=0,
        description="Longest time for one evaluation of up to 20 cycles or 10,000 samples, in seconds; in proportion "
        "for more.",
    )


class PyBaMMSimulator:
    """Simulates a task's candidates in worker processes."""

    def __init__(self, options: PyBaMMOptions, context: RunContext) -> None:
        task = context.task
        unknown = [signal.name for signal in task.signals if signal not in (*CELL.signals, TEMPERATURE, *SPECTRUM)]
        if unknown:
            raise BsaError(
                f'PyBaMM simulates cells, but task "{task.name}" has the signals {unknown}.',
                "name the task's own simulator: a scaffold's key simulator, or --set simulator.use=NAME.",
            )
        self._task = task
        self._options, self._context = options, context
        self._reduced: dict[TaskReduction, tuple[Experiment, ...]] = {}
        self._variant: tuple[tuple[Experiment, ...], WorkerPool] | None = None
        self._equilibrium: EquilibriumCell | None = None
        self._pool = self._pool_of(task.experiments, task.space.targets)

    def _pool_of(self, experiments: tuple[Experiment, ...], targets: Mapping[str, Target]) -> WorkerPool:
        """Processes that keep these experiments compiled."""
        limit_s = self._limit_s(experiments) * max(1.0, len(experiments) / len(self._task.experiments))
        service = CandidateService(self._task.cell, experiments, targets)
        return WorkerPool(service, self._context.workers, limit_s, self._context.cycled)

    def _limit_s(self, experiments: Sequence[Experiment]) -> float:
        cycles = max(len(experiment.protocol or ()) for experiment in experiments)
        samples = sum(len(experiment.target) for experiment in experiments if experiment.protocol is None)
        larger = max(1.0, cycles / _CYCLES_IN_THE_LIMIT, samples / _SAMPLES_IN_THE_LIMIT)
        return self._options.time_limit_s * larger

    @hookimpl
    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """Simulate side by side; ``exact`` uses PyBaMM's standard mesh and tight tolerances."""
        return self._pool.simulate(candidates, REFERENCE if exact else SEARCH)

    @hookimpl
    def simulate_finer(self, candidate: Candidate) -> Outcome:
        """Simulate on a mesh of 40 points in every domain."""
        ((_, outcome),) = self._pool.simulate([candidate], FINE)
        return outcome

    @hookimpl
    def simulate_low_fidelity(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]] | None:
        """Simulate a DFN on a coarser mesh; the other models take hardly less time on one."""
        if self._task.cell.model != "DFN" or any(experiment.long for experiment in self._task.experiments):
            return None
        return self._pool.simulate(candidates, LOW_FIDELITY)

    @hookimpl
    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool
    ) -> Iterator[tuple[int, Outcome]]:
        """Simulate other experiments on the task's cell.

        An experiment that the task does not have begins at its own state of charge, whatever is searched.
        """
        return self._variant_pool(experiments).simulate(candidates, REFERENCE if exact else SEARCH)

    def _variant_pool(self, experiments: tuple[Experiment, ...]) -> WorkerPool:
        """Those of other experiments; one set at a time, for each process takes 300 MB."""
        if self._variant is not None and self._variant[0] is experiments:
            return self._variant[1]
        if self._variant is not None:
            self._variant[1].close()
        own = {experiment.name for experiment in self._task.experiments}
        targets = self._task.space.targets
        if not any(experiment.name in own for experiment in experiments):
            targets = {name: target for name, target in targets.items() if not isinstance(target, InitialSoc)}
        self._variant = experiments, self._pool_of(experiments, targets)
        return self._variant[1]

    @hookimpl
    def reduce_task(self, reduction: TaskReduction) -> tuple[Experiment, ...]:
        """The task's experiments at lower currents, or their first cycles."""
        if reduction not in self._reduced:
            self._reduced[reduction] = tuple(reduced(experiment, reduction) for experiment in self._task.experiments)
        return self._reduced[reduction]

    @hookimpl
    def equilibrium(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]] | None:
        """Open-circuit voltages under measured currents."""
        if any(experiment.protocol is not None for experiment in self._task.experiments):
            return None
        if self._equilibrium is None:
            from ..solving.equilibrium import EquilibriumCell

            self._equilibrium = EquilibriumCell(self._task)
        return enumerate(map(self._equilibrium.outcome, candidates))

    @hookimpl
    def next_protocols(self) -> Mapping[str, Protocol]:
        """Protocols between the cell's own cut-offs."""
        from .next_protocols import next_protocols

        return next_protocols(self._task.cell)

    @hookimpl
    def export(self, candidate: Candidate) -> Mapping[str, str]:
        """A script that needs pybamm alone and reproduces the candidate's curves."""
        from ..export.calibrated_script import script

        return {"best_parameters.py": script(self._task, candidate)}

    @hookimpl
    def close(self) -> None:
        """End the worker processes."""
        self._pool.close()
        if self._variant is not None:
            self._variant[1].close()
