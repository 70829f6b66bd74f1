"""Where results lie: cells by identity, tasks by content, and campaigns that point to them."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.comparison.paper_metrics import PaperMetrics
from ...core.encoding import decode_task, encode_task
from ...core.errors import BsaError
from ...core.files import entries, foreign, read_json, write_text
from ...core.messages import Usage
from ...core.run.journal import FILE_NAME, read_events
from ...core.run.recording import REPLY
from ...core.shape import decoding, mapping_with, shaped
from ...core.task import Task

FINAL = frozenset({"converged", "finished", "rounds-spent", "simulations-spent"})
"""How a run ends when nothing is left to do; any other status is taken up again."""

OUTAGE = "outage"
"""How it ends when the language model could not be had: the cell failed, and is tried again."""

RESULT, TRACE, FAILURE, MANIFEST = "result.json", "trace.json", "failure.json", "grid.json"

_METRICS = frozenset(PaperMetrics.__dataclass_fields__)

GRIDS = "grids"

_PARTS = frozenset({"cells", GRIDS, "places", "tasks"})


@dataclass(frozen=True)
class Store:
    """A folder that campaigns, processes and machines share."""

    root: Path  # Holds ``cells/<identity>/`` (an ordinary run folder each), ``tasks/`` and ``grids/<name>/``.

    def check(self) -> None:
        """Refuse a folder that holds anything else than a store; nothing is written.

        Raises `BsaError` if there is something in it, and nothing that campaigns make.
        """
        found = entries(self.root)
        if found and not found & _PARTS:
            raise foreign(self.root, "a store of results")

    def cell(self, identity: str) -> Path:
        """The folder of a cell."""
        return self.root / "cells" / identity

    def grid(self, name: str) -> Path:
        """The folder of a campaign: its manifest, tables, figures and page."""
        return self.root / GRIDS / name

    def places(self, backend: str, address: str) -> Path:
        """The folder of the places at a language model; another server has places of its own."""
        return self.root / "places" / hashlib.sha256(f"{backend} {address}".encode()).hexdigest()[:12]

    def result(self, identity: str) -> dict[str, Any] | None:
        """What a finished cell found; None if it is not finished."""
        content = read_result(self.cell(identity))
        return content if content is not None and content["status"] in FINAL else None

    def journal_size(self, identity: str) -> int:
        """Bytes of a cell's journals, also of runs in folders within its own: how far it has come."""
        size = 0
        for path in self.cell(identity).rglob(FILE_NAME):
            with suppress(OSError):
                size += path.stat().st_size
        return size

    def usage(self, identity: str) -> Usage:
        """What the language model of a cell has cost so far, by its journal; nothing where there is none to read."""
        spent = Usage()
        with suppress(BsaError):
            for event in read_events(self.cell(identity)):
                if event["event"] == REPLY:
                    spent = spent + Usage(**event["usage"])
        return spent

    def put_task(self, task: Task) -> str:
        """Keep a task and say under which digest (32 hex digits)."""
        text = json.dumps(encode_task(task), sort_keys=True)
        digest = _digest(text.encode())
        if not self.has_task(digest):
            write_text(self._task(digest), text)
        return digest

    def get_task(self, digest: str) -> Task:
        """A task that was kept. Raises `BsaError` if it is not there, or damaged."""
        content = read_json(self._task(digest)) if self.has_task(digest) else None
        if content is None:
            raise BsaError(f"{self._task(digest)} is missing or damaged.", "give the command again; it writes it anew.")
        with decoding(self._task(digest), "a task", "remove the file, and give the command again; it writes it anew."):
            return decode_task(content)

    def has_task(self, digest: str) -> bool:
        """Whether a task was kept, and is whole."""
        try:
            return _digest(self._task(digest).read_bytes()) == digest
        except OSError:
            return False

    def _task(self, digest: str) -> Path:
        return self.root / "tasks" / f"{digest}.json"


_COUNTED = (
    *("simulations", "failed_simulations", "low_fidelity_simulations"),
    *("llm_calls", "lost_calls", "unusable_replies", "lost_rounds", "tokens"),
)
_MEASURED = ("cost_usd", "wall_s", "simulator_s", "low_fidelity_s", "backend_s")
_RESULT = mapping_with(
    status=str,
    best=dict[str, Any],
    initial=dict[str, Any],
    best_score=(dict[str, Any], {}),
    reason=(str, ""),
    **dict.fromkeys(_COUNTED, (int | None, None)),
    **dict.fromkeys(_MEASURED, (float | None, None)),
)
"""What tables read of a result."""


def read_result(folder: Path) -> dict[str, Any] | None:
    """What ``result.json`` of a cell holds; None where there is none, or it was damaged: the journal makes it anew."""
    content = read_json(folder / RESULT)
    try:
        found = shaped(_RESULT, content)
        parts = (found.best, found.best_score, found.initial)
        numbers = [value for part in parts for key, value in part.items() if key in _METRICS]
        shaped(list[float | None], numbers)
    except ValueError:
        return None
    return content


def best_score(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Errors of the trial with the lowest objective, by which campaigns compare; older results hold no other."""
    found: Mapping[str, Any] = result.get("best_score") or result.get("best") or {}
    return found


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]
