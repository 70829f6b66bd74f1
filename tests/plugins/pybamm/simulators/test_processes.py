import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from bsa.core.threads import VARIABLES
from bsa.plugins.pybamm.simulators.processes import Pool, Worker


def test_a_pool_that_is_closed_meanwhile_gives_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    # Ctrl-C ends the workers while other threads wait for them: that is no failed simulation.
    pool: Pool[int, str] = Pool(None, 1, 1.0)  # type: ignore[arg-type]
    monkeypatch.setattr(pool.workers[0], "submit", lambda job, allowance: None)

    def ended(busy: list[Any]) -> Iterator[tuple[Any, str]]:
        pool.close()
        yield busy[0], "the simulator process died"

    monkeypatch.setattr(pool, "_finished", ended)
    with pytest.raises(RuntimeError, match="were ended"):
        list(pool.run([1]))


def test_a_pool_that_is_closed_starts_no_process_for_a_thread_that_waited(monkeypatch: pytest.MonkeyPatch) -> None:
    pool: Pool[int, str] = Pool(None, 1, 1.0)  # type: ignore[arg-type]
    started: list[int] = []
    monkeypatch.setattr(pool.workers[0], "submit", lambda job, allowance: started.append(job))
    busy = pool._idle.get()
    waiting = threading.Event()

    def close_meanwhile() -> None:
        waiting.wait(5.0)
        pool.close()
        pool._idle.put(busy)

    def idle(must_wait: bool) -> Worker[int, str] | None:
        waiting.set()
        return pool._idle.get(timeout=5.0)

    monkeypatch.setattr(pool, "_idle_worker", idle)
    closing = threading.Thread(target=close_meanwhile)
    closing.start()
    with pytest.raises(RuntimeError, match="were ended"):
        list(pool.run([1]))
    closing.join()
    assert started == []


def test_a_report_is_told_with_the_last_ones_of_all_jobs_at_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[list[Any]] = []
    pool: Pool[int, str] = Pool(None, 3, 1.0, lambda reports: told.append(list(reports)))  # type: ignore[arg-type]
    reporting, silent, ended = pool.workers
    ends = []
    for worker, message in ((reporting, ("report", 2)), (silent, ("ready", None)), (ended, ("done", "answer"))):
        worker.connection, theirs = multiprocessing.Pipe()
        worker.deadline = time.monotonic() + 60.0
        theirs.send(message)
        ends.append(theirs)
    silent.reported = 1
    assert list(pool._finished([reporting, silent, ended])) == [(ended, "answer")]
    assert told == [[2, 1]]


def test_workers_that_threads_start_at_once_leave_the_users_process_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    second_begins, first_is_done = threading.Event(), threading.Event()

    class Slow:
        """Starts processes that are none: the first waits for the second to begin, the second for the first to end."""

        Pipe = staticmethod(multiprocessing.Pipe)

        def Process(self, **what: Any) -> "Slow":  # noqa: N802
            return self

        def start(self) -> None:
            if threading.current_thread() is first:
                second.start()
                second_begins.wait(0.5)
            else:
                second_begins.set()
                first_is_done.wait(0.5)

    def start_first() -> None:
        worker().start()
        first_is_done.set()

    def worker() -> Worker[int, str]:
        return Worker(None, 1.0)  # type: ignore[arg-type]

    monkeypatch.setattr(multiprocessing, "get_context", lambda method: Slow())
    monkeypatch.setenv(VARIABLES[0], "3")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "script.py", raising=False)
    first, second = threading.Thread(target=start_first), threading.Thread(target=lambda: worker().start())
    first.start()
    first.join()
    second.join()
    assert os.environ[VARIABLES[0]] == "3"
    assert sys.modules["__main__"].__file__ == "script.py"
