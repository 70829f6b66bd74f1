"""Worker processes that keep compiled models warm, and their watch: a hang costs one trial, not the run."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from ...core.errors import BsaError
from ...core.interrupts import in_main_thread, interrupts_wait
from ...core.parameters import Candidate
from ...core.parentage import end_with_parent
from ...core.simulation import ExperimentRun, Outcome, SimulationFailure
from ...core.target import Target, change_of
from ...core.task import CellModel, Experiment

_COMPILE_LIMIT_S = 300.0
"""Extra time for a worker's first solve, which imports PyBaMM and compiles the model."""

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Assignment:
    """What a worker simulates, over and over: the task without its bounds.

    Attributes
    ----------
    cell : CellModel
        Equations and base parameters.
    experiments : tuple of Experiment
        The records to simulate.
    targets : mapping of str to Target
        What a candidate sets, by the names that it uses.
    """

    cell: CellModel
    experiments: tuple[Experiment, ...]
    targets: Mapping[str, Target]


def serve(connection: Connection, assignment: Assignment, at_once: bool) -> None:
    """The worker's main loop: receive a candidate, report each step, send the outcome."""
    end_with_parent(at_once)
    # Ctrl-C reaches the whole process group; only the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    try:
        from .compiled import CompiledExperiment, solve_reference
        from .parameter_sets import pybamm

        pybamm.set_logging_level("CRITICAL")
        compiled = [
            CompiledExperiment(assignment.cell, experiment, assignment.targets) for experiment in assignment.experiments
        ]
    except Exception as error:
        connection.send(("unusable", _as_bsa_error(error)))
        return
    connection.send(("ready", None))
    while True:
        try:
            candidate, exact = connection.recv()
        except (EOFError, OSError):
            return
        started = time.perf_counter()
        runs: list[ExperimentRun] = []
        try:
            for number, experiment in enumerate(assignment.experiments):
                connection.send(("experiment", number))
                if exact:
                    change = change_of(assignment.targets, candidate)
                    runs.append(solve_reference(assignment.cell, experiment, change))
                else:
                    runs.append(compiled[number].solve(candidate, lambda *step: connection.send(("step", step))))
        except BsaError as error:
            connection.send(("unusable", error))
            return
        except Exception as error:  # whatever a candidate provokes is a failed trial, never the end of the run
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
            runs += [ExperimentRun(None, SimulationFailure(reason))] * (len(assignment.experiments) - len(runs))
        connection.send(("outcome", Outcome(tuple(runs), time.perf_counter() - started)))


def _as_bsa_error(error: Exception) -> BsaError:
    if isinstance(error, BsaError):
        return error
    reason = str(error).strip().splitlines()
    return BsaError(
        f"PyBaMM cannot build the model: {type(error).__name__}: {reason[0] if reason else ''}",
        "check the model options and the searched parameters; some parameters only take part with certain options.",
    )


class Worker:
    """One process with its compiled models.

    Parameters
    ----------
    assignment : Assignment
        What it simulates.
    time_limit_s : float
        Longest time for one evaluation.
    """

    def __init__(self, assignment: Assignment, time_limit_s: float) -> None:
        self._assignment = assignment
        self._time_limit_s = time_limit_s
        self._process: Any = None
        self.connection: Connection | None = None

    def start(self) -> None:
        """Start the process if it is not running."""
        if self._process is not None:
            return
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        with interrupts_wait(), _single_threaded():
            self._process = context.Process(
                target=serve, args=(theirs, self._assignment, in_main_thread()), daemon=True
            )
            self._process.start()
            theirs.close()
            self._ready = False

    def submit(self, candidate: Candidate, exact: bool) -> None:
        """Hand over a candidate; the answer comes through `receive`."""
        self.start()
        assert self.connection is not None
        self._started = time.monotonic()
        self.deadline = self._started + self._time_limit_s * (10 if exact else 1)
        if not self._ready:
            self.deadline += _COMPILE_LIMIT_S
        self._step, self._cycle, self._experiment = "", 0, 0
        # A dead process answers through `receive`.
        with suppress(OSError):
            self.connection.send((dict(candidate), exact))

    def receive(self) -> Outcome | None:
        """Read one message; the outcome if this was it, None if more is to come.

        Raises
        ------
        BsaError
            If the model cannot be built at all.
        """
        assert self.connection is not None
        try:
            kind, content = self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode
            return self._failed(f"the simulator process died (exit code {code}); out of memory or a solver crash")
        if kind == "outcome":
            self._ready = True
            return content  # type: ignore[no-any-return]
        if kind == "unusable":
            raise content
        if kind == "step":
            self._step, self._cycle = content
        elif kind == "experiment":
            self._experiment = content
        return None

    def give_up(self) -> Outcome:
        """Stop a solve that ran past its time limit."""
        return self._failed(f"no result within the time limit of {self._time_limit_s:g} s")

    def _failed(self, cause: str) -> Outcome:
        seconds = time.monotonic() - self._started
        failure = SimulationFailure(cause, self._step, self._cycle)
        done = [ExperimentRun(None, failure)] * len(self._assignment.experiments)
        self.stop()
        return Outcome(tuple(done), seconds)

    def stop(self) -> None:
        """End the process; the next `submit` starts a fresh one."""
        if self._process is None:
            return
        self._process.kill()
        self._process.join()
        assert self.connection is not None
        self.connection.close()
        self._process = None


class WorkerPool:
    """Several workers side by side.

    Parameters
    ----------
    assignment : Assignment
        What they simulate.
    size : int
        How many processes at most; each starts when first needed.
    time_limit_s : float
        Longest time for one evaluation.
    """

    def __init__(self, assignment: Assignment, size: int, time_limit_s: float) -> None:
        self._workers = [Worker(assignment, time_limit_s) for _ in range(max(size, 1))]

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """Simulate all candidates; yield the place and outcome of each as it finishes.

        Workers that are still busy when the caller stops listening are ended: their answers would be taken for those
        of the next candidates.
        """
        waiting = list(enumerate(candidates))[::-1]
        busy: dict[Worker, int] = {}
        idle = list(self._workers)[::-1]
        try:
            while waiting or busy:
                while waiting and idle:
                    worker = idle.pop()
                    number, candidate = waiting.pop()
                    worker.submit(candidate, exact)
                    busy[worker] = number
                for worker, outcome in self._finished(list(busy)):
                    idle.append(worker)
                    yield busy.pop(worker), outcome
        finally:
            for worker in busy:
                worker.stop()

    def _finished(self, busy: list[Worker]) -> Iterator[tuple[Worker, Outcome]]:
        by_connection = {worker.connection: worker for worker in busy}
        patience = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
        for connection in wait([worker.connection for worker in busy if worker.connection], patience):
            worker = by_connection[connection]  # type: ignore[index]
            outcome = worker.receive()
            if outcome is not None:
                yield worker, outcome
                busy.remove(worker)
        for worker in busy:
            if time.monotonic() > worker.deadline:
                yield worker, worker.give_up()

    def close(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.stop()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Children inherit one thread each: the parallelism is in the processes."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
