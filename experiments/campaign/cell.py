"""One cell of a campaign, carried out in whichever process: locked, run or taken up again, and reported."""

import multiprocessing
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

from filelock import FileLock, Timeout

from ...core.errors import BsaError
from ...core.files import file_error, write_json
from ...core.messages import Outage
from ...core.resident_memory import resident_mb
from ...core.run.journal import LOCK
from .store import FAILURE, FINAL, OUTAGE, Store

State = Literal["done", "busy", "stopped", "failed", "lost"]

Axis = Literal["task", "mode", "chemistry", "rates", "scaffold", "backend", "seed"]


@dataclass(frozen=True, kw_only=True)
class Axes:
    """What tables group cells by, and an exclusion of a grid tests."""

    task: str
    mode: str
    chemistry: str = ""
    rates: str = ""
    scaffold: str  # Of an item of a study: its method.
    backend: str = "none"
    seed: int = 0


class Cell(Protocol):
    """A calibration or a discovery of a campaign; it is pickled on its way to the worker that carries it out."""

    @property
    def identity(self) -> str:
        """Hash of everything that determines the result, and name of its folder; empty where it cannot be run."""

    @property
    def axes(self) -> Axes:
        """What tables group by."""

    @property
    def trouble(self) -> str:
        """Why it cannot be run; empty where it can."""

    def run(self, folder: Path, store: Store) -> Mapping[str, Any]:
        """Run to the end, or go on from what the folder holds, and return the content of its ``result.json``."""


@dataclass(frozen=True)
class Report:
    """What became of a cell that was handed out."""

    identity: str  # Of the cell.
    state: State  # ``busy``: another process has it. ``stopped``: interrupted. ``lost``: its worker died.
    result: Mapping[str, Any] = field(default_factory=dict)  # What ``result.json`` holds, where there is one.
    reason: str = ""  # Why it failed.
    memory_mb: float = 0.0  # Resident memory of the worker afterwards, without the language models that it keeps.


def carry_out(cell: Cell, store: Store) -> Report:
    """Run a cell to its end, or take it up where it was left.

    Whatever goes wrong with it is reported, never raised: it must not cost the worker or the campaign.
    """
    folder = store.cell(cell.identity)
    try:
        with FileLock(folder / LOCK, timeout=0):
            return _locked(cell, store, folder)
    except Timeout:
        return Report(cell.identity, "busy")
    except KeyboardInterrupt:
        return Report(cell.identity, "stopped")
    except Exception as error:
        worded = file_error(error) if isinstance(error, OSError) else error
        reason = str(worded) if isinstance(worded, (BsaError, Outage)) else f"{type(error).__name__}: {error}"
        with suppress(BsaError):  # a full disk, perhaps; the report tells the reason
            write_json(folder / FAILURE, {"reason": reason})
        return Report(cell.identity, "failed", reason=reason, memory_mb=memory_mb())


def _locked(cell: Cell, store: Store, folder: Path) -> Report:
    # Another process may have finished it since it was handed out.
    result: Mapping[str, Any] | None = store.result(cell.identity)
    if result is None:
        _allow_children()
        (folder / FAILURE).unlink(missing_ok=True)  # of the time before
        result = cell.run(folder, store)
        if result["status"] == OUTAGE:
            raise Outage(result["reason"])
    state: State = "done" if result["status"] in FINAL else "stopped"
    return Report(cell.identity, state, result, memory_mb=memory_mb())


def _allow_children() -> None:
    """Let this process start others: Dask marks its workers as daemons, whose children multiprocessing forbids.

    Ours end by themselves when the pipe to their parent closes, which is what the rule is there for.
    """
    process: Any = multiprocessing.current_process()
    if process.daemon:
        process._config["daemon"] = False


def memory_mb() -> float:
    """Resident memory of this process without its language models, MB; 0 where the system does not tell.

    A worker that was replaced for the size of its model would load it again for each cell.
    """
    from ...backends.loaded_model import taken_mb

    return max(resident_mb() - taken_mb(), 0.0)
