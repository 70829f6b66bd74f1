"""Where results lie: cells by identity, tasks by content, and grids that point to them."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.encoding import decode_task, encode_task
from ...core.errors import BsaError
from ...core.journal import FILE_NAME
from ...core.task import Task

FINAL = frozenset({"converged", "finished", "rounds-spent", "simulations-spent"})
"""How a run ends when nothing is left to do; any other status is taken up again."""

RESULT, TRACE, FAILURE, MANIFEST = "result.json", "trace.json", "failure.json", "grid.json"


@dataclass(frozen=True)
class Store:
    """A folder that grids, processes and machines share.

    Attributes
    ----------
    root : Path
        Holds ``cells/<identity>/`` (an ordinary run folder each), ``tasks/`` and ``grids/<name>/``.
    """

    root: Path

    def cell(self, identity: str) -> Path:
        """The folder of a cell."""
        return self.root / "cells" / identity

    def grid(self, name: str) -> Path:
        """The folder of a grid: its manifest, tables, figures and page."""
        return self.root / "grids" / name

    def places(self, backend: str, address: str) -> Path:
        """The folder of the places at a language model; another server has places of its own."""
        return self.root / "places" / hashlib.sha256(f"{backend} {address}".encode()).hexdigest()[:12]

    def result(self, identity: str) -> dict[str, Any] | None:
        """What a finished cell found; None if it is not finished."""
        content = read_json(self.cell(identity) / RESULT)
        return content if content is not None and content.get("status") in FINAL else None

    def journal_size(self, identity: str) -> int:
        """Bytes of a cell's journal: how far it has come."""
        try:
            return (self.cell(identity) / FILE_NAME).stat().st_size
        except OSError:
            return 0

    def put_task(self, task: Task) -> str:
        """Keep a task and say under which digest (32 hex digits)."""
        text = json.dumps(encode_task(task), sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()[:32]
        path = self._task(digest)
        if not path.is_file():
            write_text(path, text)
        return digest

    def get_task(self, digest: str) -> Task:
        """A task that was kept.

        Raises
        ------
        BsaError
            If it is not there, or damaged.
        """
        content = read_json(self._task(digest))
        if content is None:
            raise BsaError(f"{self._task(digest)} is missing or damaged.", "start the grid again; it writes it anew.")
        return decode_task(content)

    def has_task(self, digest: str) -> bool:
        """Whether a task was kept."""
        return self._task(digest).is_file()

    def _task(self, digest: str) -> Path:
        return self.root / "tasks" / f"{digest}.json"


def read_json(path: Path) -> dict[str, Any] | None:
    """A JSON object; None where there is none, or half of one."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON object, whole or not at all."""
    write_text(path, json.dumps(content, ensure_ascii=False))


def write_text(path: Path, text: str) -> None:
    """Write a text, whole or not at all, whoever else is writing it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{os.getpid()}.part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)
