"""Workers of a Dask cluster: one that runs already, or one of SLURM jobs."""

import math
import queue
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from ...core import threads
from ...core.errors import BsaError
from ...core.extras import require
from ...core.run.interrupts import interrupts_stay
from ...core.validation import validated
from ...core.yaml_text import read_yaml
from .cell import Cell, Report, carry_out
from .store import Store

_SLURM = "slurm:"

_ADDRESS = re.compile(r"(tcp|tls)://\S+:\d{1,5}")

_AHEAD = 2
"""Cells in flight for each worker thread: one that runs and one that waits beside it."""

_CONNECT_S = 30

_COUNT_EVERY_S = 2.0
"""Asking a scheduler of hundreds of workers for each cell would cost more than to hand it over."""


class SlurmConfig(BaseModel):
    """How a SLURM job of workers looks; other keys go to dask-jobqueue's SLURMCluster as they are."""

    model_config = ConfigDict(extra="allow")

    jobs: int = Field(ge=1, description="How many jobs to ask for.")
    cores: int = Field(1, ge=1, description="Cores of a job, each with a worker process of one thread.")
    memory: str = Field("4GB", description="Memory of a job.")
    walltime: str = Field("24:00:00", description="Longest time of a job.")
    job_script_prologue: list[str] = Field([], description="Lines of shell before the workers are started.")


def slurm_cluster(config: SlurmConfig) -> Any:
    """A cluster whose workers are SLURM jobs, none submitted yet. Raises `BsaError` if dask-jobqueue refuses a key."""
    # Imported, it makes Ctrl-C end the process in silence and with exit code 0.
    with interrupts_stay():
        jobqueue = require("dask_jobqueue", "cluster", "--cluster slurm:...")
    lines = [f"export {name}=1" for name in threads.VARIABLES]
    try:
        return jobqueue.SLURMCluster(
            cores=config.cores,
            processes=config.cores,
            memory=config.memory,
            walltime=config.walltime,
            job_script_prologue=[*lines, *config.job_script_prologue],
            **(config.model_extra or {}),
        )
    except (TypeError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise BsaError(
            f"dask-jobqueue refuses the SLURM jobs that are described: {reason}",
            "its SLURMCluster tells which keys there are; each of the cores has a process of its own.",
        ) from None


def check_cluster(where: str) -> SlurmConfig | None:
    """What a cluster is to be made of; None where it runs already.

    Raises `BsaError` if ``where`` is neither the address of a scheduler nor a description of SLURM jobs, or that cannot
    be read.
    """
    if where.startswith(_SLURM):
        path = where.removeprefix(_SLURM)
        return validated(SlurmConfig, read_yaml(Path(path)) or {}, path)
    if not _ADDRESS.fullmatch(where):
        raise BsaError(f'--cluster "{where}" is no cluster.', "write tcp://HOST:PORT or slurm:FILE.yaml.")
    return None


class DaskPool:
    """Workers of a Dask cluster; all must see the store's folder and have this package installed.

    ``where`` is ``tcp://HOST:PORT`` of a scheduler, or ``slurm:FILE``. Raises `BsaError` if Dask is not installed, or
    no scheduler answers.
    """

    def __init__(self, where: str) -> None:
        distributed = require("distributed", "cluster", "--cluster")
        self._cluster: Any = None
        address: Any = where
        config = check_cluster(where)
        if config is not None:
            self._cluster = address = slurm_cluster(config)
            self._cluster.scale(jobs=config.jobs)
        try:
            self._client: Any = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except OSError as error:
            raise BsaError(
                f"no Dask scheduler answers at {where} ({error}).", "start one with: dask scheduler; then dask worker."
            ) from None
        self._cells: dict[Any, Cell] = {}
        self._finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._number = 0
        self._threads, self._counted_at = 0, -math.inf

    @property
    def workers(self) -> int:
        """How many cells run side by side: threads of all workers, not more than a moment ago."""
        now = time.monotonic()
        if now - self._counted_at > _COUNT_EVERY_S:
            workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
            self._threads, self._counted_at = sum(worker["nthreads"] for worker in workers), now
        return self._threads

    @property
    def free(self) -> int:
        """How many more cells may be handed over now."""
        return max(_AHEAD * self.workers, 1) - len(self._cells)

    def submit(self, cell: Cell, store: Store) -> None:
        """Hand a cell to the scheduler."""
        self._number += 1
        # Dask runs the tasks of a lost worker again by itself, and gives up after a few; the grid counts them anew.
        # A worker may have been started in another folder.
        store = Store(store.root.absolute())
        future = self._client.submit(carry_out, cell, store, key=f"{cell.identity}-{self._number}", pure=False)
        self._cells[future] = cell
        future.add_done_callback(self._finished.put)

    def collect(self, patience_s: float) -> list[Report]:
        """Wait until a report is there, ``patience_s`` at most."""
        futures: list[Any] = []
        with suppress(queue.Empty):
            futures.append(self._finished.get(timeout=max(patience_s, 0.001)))
            while True:
                futures.append(self._finished.get_nowait())
        return [self._report(future) for future in futures]

    def _report(self, future: Any) -> Report:
        cell = self._cells.pop(future)
        if future.status == "finished":
            report: Report = future.result()
            return report
        error = future.exception() if future.status == "error" else None
        return Report(cell.identity, "lost", reason=f"{type(error).__name__}: {error}" if error else future.status)

    def close(self) -> None:
        """Take back what has not begun and let the cluster go; one that we started is ended."""
        self._client.cancel(list(self._cells))
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()
