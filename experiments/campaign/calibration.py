"""A cell that is a calibration: a task, a scaffold, a language model and a seed."""

import time
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...core.files import read_json, write_json
from ...core.messages import Backend
from ...core.run.journal import FILE_NAME
from ...core.run.run_config import RunConfig
from ...core.task import Task
from .cell import Axes
from .grid_file import BackendChoice
from .model_places import SharedBackend
from .store import RESULT, TRACE, Store
from .trace import Stopwatch, Trace


@dataclass(frozen=True)
class TaskLabel:
    """A task as tables see it."""

    key: str  # Its name, unique in the grid.
    # mode, chemistry, rates: Mode of the suite, parameter set, C-rates.
    mode: str
    chemistry: str
    rates: str = ""
    digest: str = ""  # Of the encoded task in the store; empty while it is not made, or cannot be.
    trouble: str = ""  # Why there is no task: PyBaMM cannot simulate the true cell.
    simulator: str = ""  # The simulator that the task names; empty leaves it to the scaffold.
    effects: tuple[str, ...] = ()  # Names of the effects that its cell has.


@dataclass(frozen=True)
class Calibration:
    """A calibration; see `Cell`."""

    task: TaskLabel  # What is fitted.
    backend: BackendChoice  # The language model, with where it is.
    config: RunConfig  # What, with the task and the code, determines the result.
    identity: str = ""  # Hash of all that; empty while the task is not made.

    @property
    def axes(self) -> Axes:
        """See `Cell.axes`."""
        return Axes(
            task=self.task.key,
            mode=self.task.mode,
            chemistry=self.task.chemistry,
            rates=self.task.rates,
            scaffold=self.config.scaffold.name,
            backend=self.backend.use,
            seed=self.config.seed,
        )

    @property
    def trouble(self) -> str:
        """Why there is no task."""
        return self.task.trouble

    def run(self, folder: Path, store: Store) -> dict[str, Any]:
        """See `Cell.run`."""
        from ..run import execute_run

        task = _task(store, self.task.digest)
        resumed = (folder / FILE_NAME).is_file()
        stopwatch, started = Stopwatch(), time.perf_counter()
        outcome = execute_run(task, self.config, folder, _backend(self, store), listener=stopwatch, report=False)
        trace = Trace(
            [trial.objective if trial.ok else None for trial in outcome.trials],
            "".join(trial.phase[0] for trial in outcome.trials),
            # Of a run that was taken up again only the last part has times, which would say nothing.
            [] if resumed else stopwatch.rounds,
            max(0.0, stopwatch.proposer_s - outcome.usage.seconds),
            resumed,
            time.perf_counter() - started,
        )
        write_json(folder / TRACE, asdict(trace))
        content = read_json(folder / RESULT)
        assert content is not None
        return content


def _backend(cell: Calibration, store: Store) -> Backend:
    from ...backends.opening import open_backend

    chosen = cell.backend
    backend = open_backend(chosen.use, chosen.options)
    if chosen.at_once is None:
        return backend
    return SharedBackend(backend, store.places(chosen.use, str(chosen.options.get("base_url", ""))), chosen.at_once)


@lru_cache(maxsize=8)
def _task(store: Store, digest: str) -> Task:
    return store.get_task(digest)
