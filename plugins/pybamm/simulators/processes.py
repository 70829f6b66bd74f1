"""Worker processes that do many jobs each, and are watched: a hang or a crash loses one job, not the run."""

import multiprocessing
import queue
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, Protocol, TypeVar

from ....core.errors import BsaError
from ....core.run.interrupts import in_main_thread, interrupts_wait
from ....core.run.parentage import end_with_parent
from ....core.threads import one_thread_for_children
from ..modelling.scratch import remove_scratch_of

Job = TypeVar("Job", contravariant=True)
Answer = TypeVar("Answer", covariant=True)

START_LIMIT_S = 300.0
"""Extra time for a worker's first job, before which it imports PyBaMM and compiles models."""

_STARTING = threading.Lock()
"""Held while a worker starts: what it inherits stands in the process's environment meanwhile, and is put back after."""

Report = Callable[[Any], None]
"""Tells the parent how far a job has come."""

Watch = Callable[[Sequence[Any]], None]
"""Called whenever a job reports, with the last report of each job that is being done."""


class Service(Protocol[Job, Answer]):
    """What the workers of a pool do; made in the parent, pickled, and used in each worker."""

    def prepare(self) -> None:
        """Import and compile in the worker what every job needs.

        Raises `BsaError` if no job can be done at all; the whole pool is then of no use, and says so.
        """
        ...

    def work(self, job: Job, report: Report) -> Answer:
        """Do one job in the worker. A `BsaError` ends the pool; any other exception costs the job."""
        ...

    def lost(self, cause: str, seconds: float, reported: Any) -> Answer:
        """The answer for a job whose worker died, hung or raised, called in the parent.

        ``cause`` is what became of it, in a line, and ``reported`` what it reported last; None if it never did.
        """
        ...


def serve(connection: Connection, service: Service[Any, Any], at_once: bool) -> None:
    """The worker's main loop: receive a job, report, send the answer."""
    end_with_parent(at_once)
    # Ctrl-C reaches the whole process group; only the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    try:
        service.prepare()
    except Exception as error:
        connection.send(("unusable", as_bsa_error(error)))
        return
    connection.send(("ready", None))
    while True:
        try:
            job = connection.recv()
        except (EOFError, OSError):
            return
        started = time.perf_counter()
        try:
            answer = ("done", service.work(job, lambda progress: connection.send(("report", progress))))
        except BsaError as error:
            answer = ("unusable", error)
        except Exception as error:  # whatever a job provokes costs that job, never the run
            reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
            answer = ("lost", (reason, time.perf_counter() - started))
        connection.send(answer)


def as_bsa_error(error: Exception) -> BsaError:
    """What kept a worker from preparing, as an error for the user."""
    if isinstance(error, BsaError):
        return error
    reason = str(error).strip().splitlines()
    return BsaError(
        f"PyBaMM cannot build the model: {type(error).__name__}: {reason[0] if reason else ''}",
        "check the model options and the searched parameters; some parameters only take part with certain options.",
    )


class Worker(Generic[Job, Answer]):
    """One process."""

    def __init__(self, service: Service[Job, Answer], time_limit_s: float) -> None:
        self._service = service
        self._time_limit_s = self._allowed_s = time_limit_s
        self._process: Any = None
        self.connection: Connection | None = None
        self.deadline = 0.0
        self.reported: Any = None  # What its job has reported last.

    def start(self) -> None:
        """Start the process if it is not running."""
        if self._process is not None:
            return
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        with interrupts_wait(), _STARTING, one_thread_for_children(), _script_left_out():
            self._process = context.Process(target=serve, args=(theirs, self._service, in_main_thread()), daemon=True)
            self._process.start()
            theirs.close()
            self._ready = False

    def submit(self, job: Job, allowance: float = 1.0) -> None:
        """Hand over a job that may take ``allowance`` times the time limit; the answer comes through `receive`."""
        self.start()
        assert self.connection is not None
        self._started = time.monotonic()
        self._allowed_s = self._time_limit_s * allowance
        self.deadline = self._started + self._allowed_s
        if not self._ready:
            self.deadline += START_LIMIT_S
        self.reported = None
        # A dead process answers through `receive`.
        with suppress(OSError):
            self.connection.send(job)

    def receive(self) -> tuple[Answer] | None:
        """Read one message; the answer (in a tuple of one) if this was it, None if more is to come.

        Raises `BsaError` if no job can be done at all.
        """
        assert self.connection is not None
        try:
            kind, content = self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode
            return self._lost(f"the simulator process died (exit code {code}); out of memory or a solver crash")
        if kind == "unusable":
            raise content
        if kind == "report":
            self.reported = content
            return None
        self._ready = True
        if kind == "done":
            return (content,)
        if kind == "lost":
            cause, seconds = content
            return (self._service.lost(cause, seconds, self.reported),)
        return None

    def give_up(self) -> tuple[Answer]:
        """Stop a job that ran past its time limit."""
        return self._lost(f"no result within the time limit of {self._allowed_s:g} s")

    def _lost(self, cause: str) -> tuple[Answer]:
        answer = self._service.lost(cause, time.monotonic() - self._started, self.reported)
        self.stop()
        return (answer,)

    def stop(self) -> None:
        """End the process; the next `submit` starts a fresh one."""
        if self._process is None:
            return
        self._process.kill()
        self._process.join()
        remove_scratch_of(self._process.pid)
        assert self.connection is not None
        self.connection.close()
        self._process = None


class Pool(Generic[Job, Answer]):
    """At most ``size`` workers side by side, each started when first needed; threads may share it."""

    def __init__(
        self,
        service: Service[Job, Answer],
        size: int,
        time_limit_s: float,
        watch: Watch = lambda reports: None,
    ) -> None:
        self._watch = watch
        self.workers = [Worker(service, time_limit_s) for _ in range(max(size, 1))]
        self._idle: queue.LifoQueue[Worker[Job, Answer]] = queue.LifoQueue()
        for worker in reversed(self.workers):
            self._idle.put(worker)
        self._closed = False

    def run(self, jobs: Sequence[Job], allowance: float = 1.0) -> Iterator[tuple[int, Answer]]:
        """Do all jobs, each within ``allowance`` times the time limit; their places and answers as they finish."""
        waiting = list(enumerate(jobs))[::-1]
        busy: dict[Worker[Job, Answer], int] = {}
        try:
            while waiting or busy:
                self._check_open()
                while waiting and (worker := self._idle_worker(must_wait=not busy)) is not None:
                    place, job = waiting.pop()
                    busy[worker] = place
                    self._check_open()  # it may have waited for the worker
                    worker.submit(job, allowance)
                for worker, answer in self._finished(list(busy)):
                    # A worker that was ended has not failed its job: nobody may write that down.
                    self._check_open()
                    self._idle.put(worker)
                    yield busy.pop(worker), answer
        finally:
            for worker in busy:
                # What it is doing is of no use any more.
                worker.stop()
                self._idle.put(worker)

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the worker processes were ended")  # for threads that nobody waits for any more

    def _idle_worker(self, must_wait: bool) -> Worker[Job, Answer] | None:
        try:
            return self._idle.get(block=must_wait)
        except queue.Empty:
            return None

    def _finished(self, busy: list[Worker[Job, Answer]]) -> Iterator[tuple[Worker[Job, Answer], Answer]]:
        by_connection = {worker.connection: worker for worker in busy}
        patience = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
        for connection in wait([worker.connection for worker in busy if worker.connection], patience):
            worker = by_connection[connection]  # type: ignore[index]
            before, answer = worker.reported, worker.receive()
            if answer is not None:
                busy.remove(worker)
                yield worker, answer[0]
            elif worker.reported is not before:
                self._watch([one.reported for one in busy if one.reported is not None])
        for worker in busy:
            if time.monotonic() > worker.deadline:
                yield worker, worker.give_up()[0]

    def close(self) -> None:
        """End all processes, also while other threads wait for them."""
        self._closed = True
        for worker in self.workers:
            worker.stop()


@contextmanager
def _script_left_out() -> Iterator[None]:
    """Children do not run the caller's script again: one without a main guard would start its own run in each child."""
    main = sys.modules["__main__"].__dict__
    before: dict[str, Any] = {name: main[name] for name in ("__spec__", "__file__") if name in main}
    main.update(dict.fromkeys(before))
    try:
        yield
    finally:
        main.update(before)
