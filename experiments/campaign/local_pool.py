"""Worker processes of this machine: one cell each at a time, replaced when they die or grow."""

import multiprocessing
import signal
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from ...core.run.interrupts import in_main_thread, interrupts_wait
from ...core.run.parentage import end_with_parent
from ...core.threads import one_thread_for_children
from .cell import Cell, Report, carry_out
from .store import Store

CELLS_PER_WORKER = 500
MEMORY_LIMIT_MB = 1500.0
"""A worker that has run so many cells, or has grown past this, is replaced after its cell, whatever leaks in it; its
simulator is a process of its own. ``--memory-limit`` has the same default."""


def _serve(connection: Connection, at_once: bool) -> None:
    """A worker's main loop."""
    # Ctrl-C reaches the whole process group; only the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(at_once)
    while True:
        try:
            cell, store = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(carry_out(cell, store))


@dataclass(eq=False)
class _Worker:
    process: Any
    connection: Connection
    cell: Cell | None = None  # What it does; None where it is idle.
    cells: int = 0  # How many it has done.


class LocalPool:
    """Worker processes.

    A worker is replaced after ``cells_per_worker`` cells, and after a cell that leaves it larger than
    ``memory_limit_mb``.
    """

    def __init__(
        self, size: int, cells_per_worker: int = CELLS_PER_WORKER, memory_limit_mb: float = MEMORY_LIMIT_MB
    ) -> None:
        self.workers = max(size, 1)
        """How many cells run side by side."""
        self._cells_per_worker = cells_per_worker
        self._memory_limit_mb = memory_limit_mb
        self._workers: list[_Worker] = []
        self._environment = ExitStack()
        self._environment.enter_context(one_thread_for_children())

    @property
    def free(self) -> int:
        """How many more cells may be handed over now."""
        return self.workers - sum(worker.cell is not None for worker in self._workers)

    def submit(self, cell: Cell, store: Store) -> None:
        """Hand a cell to an idle worker, started if need be."""
        worker = next((worker for worker in self._workers if worker.cell is None), None) or self._start()
        worker.cell = cell
        # A dead worker answers through `collect`.
        with suppress(OSError):
            worker.connection.send((cell, store))

    def _start(self) -> _Worker:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, in_main_thread()), name="bsa-grid-worker")
        worker = _Worker(process, ours)
        with interrupts_wait():
            worker.process.start()
            theirs.close()
            self._workers.append(worker)
        return worker

    def collect(self, patience_s: float) -> list[Report]:
        """Wait until a report is there, ``patience_s`` at most."""
        busy = {worker.connection: worker for worker in self._workers if worker.cell is not None}
        if not busy:
            return []
        return [self._receive(busy[connection]) for connection in wait(list(busy), patience_s)]  # type: ignore[index]

    def _receive(self, worker: _Worker) -> Report:
        assert worker.cell is not None
        try:
            report: Report = worker.connection.recv()
        except (EOFError, OSError):
            worker.process.join()
            self._workers.remove(worker)
            worker.connection.close()
            reason = f"its worker died (exit code {worker.process.exitcode})"
            return Report(worker.cell.identity, "lost", reason=reason)
        worker.cell = None
        worker.cells += 1
        if worker.cells >= self._cells_per_worker or report.memory_mb > self._memory_limit_mb:
            self._end(worker)
        return report

    def _end(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.process.kill()
        worker.process.join()
        worker.connection.close()

    def close(self) -> None:
        """End the workers at once; what they were doing stands in its journal."""
        for worker in list(self._workers):
            self._end(worker)
        self._environment.close()
