"""A task's candidates, simulated in worker processes that keep its compiled models warm."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from ....core.errors import BsaError
from ....core.parameters import Candidate
from ....core.simulation import ExperimentRun, Outcome, SimulationFailure
from ....core.target import Target, change_of
from ....core.task import CellModel, Experiment
from ..modelling.resolution import FINE, LOW_FIDELITY, REFERENCE, SEARCH, Resolution
from .processes import Pool, Report

_ALLOWANCES = {SEARCH: 1.0, LOW_FIDELITY: 2.0, REFERENCE: 10.0, FINE: 10.0}
"""How many times as long as in a search a simulation may take. The low-fidelity model is compiled with its first
candidate; a reference solve builds its model anew, on a finer mesh at tighter tolerances."""


class CandidateService:
    """Simulates every experiment for one candidate after another; see `Service`.

    ``targets`` are what a candidate sets, by the names that it uses.
    """

    def __init__(self, cell: CellModel, experiments: tuple[Experiment, ...], targets: Mapping[str, Target]) -> None:
        self._cell, self.experiments, self._targets = cell, experiments, targets
        self._compiled: dict[Resolution, list[Any]] = {}

    def prepare(self) -> None:
        """Compile the experiments."""
        from ..cells.parameter_sets import pybamm

        pybamm.set_logging_level("CRITICAL")
        self._experiments_at(SEARCH)

    def _experiments_at(self, resolution: Resolution) -> list[Any]:
        """The experiments, compiled once, at the accuracy of the search, or of the low-fidelity model."""
        from ..solving.experiment_kinds import compiled

        if resolution not in self._compiled:
            self._compiled[resolution] = [
                compiled(self._cell, experiment, self._targets, resolution) for experiment in self.experiments
            ]
        return self._compiled[resolution]

    def work(self, job: tuple[Candidate, Resolution], report: Report) -> Outcome:
        """Simulate a candidate; what it provokes is a failed trial with the experiments that were done before."""
        candidate, resolution = job
        started = time.perf_counter()
        runs: list[ExperimentRun] = []
        try:
            for number in range(len(self.experiments)):
                runs.append(self._simulate(number, candidate, resolution, report))
        except BsaError:
            raise
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
            runs += [ExperimentRun(None, SimulationFailure(reason))] * (len(self.experiments) - len(runs))
        return Outcome(tuple(runs), time.perf_counter() - started)

    def _simulate(self, number: int, candidate: Candidate, resolution: Resolution, report: Report) -> ExperimentRun:
        from ..solving.experiment_kinds import solve_reference

        def on_step(step: str, cycle: int) -> None:
            report((number, step, cycle))

        if resolution not in (SEARCH, LOW_FIDELITY):
            change = change_of(self._targets, candidate)
            return solve_reference(self._cell, self.experiments[number], change, resolution, on_step)
        run: ExperimentRun = self._experiments_at(resolution)[number].solve(candidate, on_step)
        return run

    def lost(self, cause: str, seconds: float, reported: Any) -> Outcome:
        """A trial that failed in the step that was reported last."""
        _, step, cycle = reported or (0, "", 0)
        failure = SimulationFailure(cause, step, cycle)
        return Outcome((ExperimentRun(None, failure),) * len(self.experiments), seconds)


class WorkerPool:
    """Simulates candidates side by side, in at most ``size`` processes; each starts when first needed.

    ``cycled`` is told of lives the cycle of the simulation that is farthest, and how many cycles that one has.
    """

    def __init__(
        self,
        service: CandidateService,
        size: int,
        time_limit_s: float,
        cycled: Callable[[int, int], None] = lambda cycle, cycles: None,
    ) -> None:
        self._cycles = [len(e.protocol or ()) if e.long else 0 for e in service.experiments]
        self._cycled, self._told = cycled, (0, 0)
        self.processes = Pool(service, size, time_limit_s, self._watch)

    def _watch(self, reports: Sequence[tuple[int, str, int]]) -> None:
        number, _, cycle = max(reports, key=lambda report: (report[0], report[2]))
        if self._cycles[number] and (number, cycle) != self._told:
            self._told = number, cycle
            self._cycled(cycle, self._cycles[number])

    def simulate(
        self, candidates: Sequence[Candidate], resolution: Resolution = SEARCH
    ) -> Iterator[tuple[int, Outcome]]:
        """Simulate all candidates; the place and the outcome of each as it finishes."""
        jobs = [(dict(candidate), resolution) for candidate in candidates]
        return self.processes.run(jobs, _ALLOWANCES[resolution])

    def close(self) -> None:
        """End all processes."""
        self.processes.close()
