"""One cell carried out, in whichever process: claimed, run or resumed, and reported."""

from __future__ import annotations

import multiprocessing
import time
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from ...core.errors import BsaError
from ...core.files import file_error, read_json, write_json
from ...core.journal import CLAIM
from ...core.loop import RunResult
from ...core.messages import Backend, Outage
from ...core.run_config import RunConfig
from ...core.task import Task
from .claim import claim
from .expansion import GridCell
from .model_places import SharedBackend
from .store import FAILURE, FINAL, OUTAGE, TRACE, Store

State = Literal["done", "busy", "stopped", "failed", "lost"]


@dataclass(frozen=True)
class Order:
    """A cell to be carried out, in plain data that any process understands.

    Attributes
    ----------
    identity, task : str
        Of the cell, and digest of its task.
    config : dict
        Its `RunConfig`.
    backend_options : dict
        Options of the language model, placement included.
    places : int or None
        Calls of the model at a time.
    store : str
        The store's root.
    """

    identity: str
    task: str
    config: dict[str, Any]
    backend_options: dict[str, Any]
    places: int | None
    store: str


@dataclass(frozen=True)
class Report:
    """What became of an order.

    Attributes
    ----------
    identity : str
        Of the cell.
    state : {'done', 'busy', 'stopped', 'failed', 'lost'}
        ``busy``: another process has it. ``stopped``: interrupted. ``lost``: its worker died.
    result : dict
        What ``result.json`` holds, where there is one.
    reason : str
        Why it failed.
    memory_mb : float
        Resident memory of the worker afterwards.
    """

    identity: str
    state: State
    result: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    memory_mb: float = 0.0


def order_for(cell: GridCell, store: Store) -> Order:
    """The order for a cell."""
    return Order(
        cell.identity,
        cell.task.digest,
        cell.config.model_dump(mode="json"),
        cell.backend.options,
        cell.backend.at_once,
        str(store.root),
    )


def carry_out(order: Order) -> Report:
    """Run a cell to its end, or take it up where it was left.

    Whatever goes wrong with it is reported, never raised: it must not cost the worker or the grid.
    """
    store = Store(Path(order.store))
    folder = store.cell(order.identity)
    try:
        with claim(folder / CLAIM) as ours:
            return _claimed(order, store, folder) if ours else Report(order.identity, "busy")
    except KeyboardInterrupt:
        return Report(order.identity, "stopped")
    except Exception as error:
        worded = file_error(error) if isinstance(error, OSError) else error
        reason = str(worded) if isinstance(worded, (BsaError, Outage)) else f"{type(error).__name__}: {error}"
        with suppress(BsaError):  # a full disk, perhaps; the report tells the reason
            write_json(folder / FAILURE, {"reason": reason})
        return Report(order.identity, "failed", reason=reason, memory_mb=memory_mb())


def _claimed(order: Order, store: Store, folder: Path) -> Report:
    # Another process may have finished it since the order was written.
    result = store.result(order.identity)
    if result is None:
        result = _run(order, store, folder)
        if result["status"] == OUTAGE:
            raise Outage(result["reason"])
        (folder / FAILURE).unlink(missing_ok=True)
    state: State = "done" if result["status"] in FINAL else "stopped"
    return Report(order.identity, state, result, memory_mb=memory_mb())


def _run(order: Order, store: Store, folder: Path) -> dict[str, Any]:
    from ..run import execute_run

    _allow_children()
    task = _task(order.store, order.task)
    config = RunConfig.model_validate(order.config)
    started = time.perf_counter()
    outcome = execute_run(task, config, folder, _backend(order, store), report=False)
    write_json(folder / TRACE, {**_trace(outcome), "run_s": time.perf_counter() - started})
    content = read_json(folder / "result.json")
    assert content is not None
    return content


def _backend(order: Order, store: Store) -> Backend:
    from ...backends.opening import open_backend

    name = str(order.config["backend"])
    backend = open_backend(name, order.backend_options)
    if order.places is None:
        return backend
    address = str(order.backend_options.get("base_url", ""))
    return SharedBackend(backend, store.places(name, address), order.places)


@lru_cache(maxsize=8)
def _task(store: str, digest: str) -> Task:
    return Store(Path(store)).get_task(digest)


def _trace(outcome: RunResult) -> dict[str, Any]:
    """What figures need of every simulation, so that they need not read journals of megabytes."""
    return {
        "objective": [trial.objective if trial.ok else None for trial in outcome.trials],
        "phase": "".join(trial.phase[0] for trial in outcome.trials),
    }


def _allow_children() -> None:
    """Let this process start others: Dask marks its workers as daemons, whose children multiprocessing forbids.

    Ours end by themselves when the pipe to their parent closes, which is what the rule is there for.
    """
    process: Any = multiprocessing.current_process()
    if process.daemon:
        process._config["daemon"] = False


def memory_mb() -> float:
    """Resident memory of this process, MB; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    import resource

    return pages * resource.getpagesize() / 1e6
