"""A run on disk: an append-only journal from which it can be resumed, redrawn and audited."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from .errors import BsaError

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no flock; there a second writer is not noticed
    fcntl = None  # type: ignore[assignment]

FORMAT = 1
FILE_NAME = "journal.jsonl"

Event = Mapping[str, Any]


class Journal:
    """Appends events to ``journal.jsonl``, each on disk before the run goes on.

    Parameters
    ----------
    folder : Path
        The run's folder; made if missing.

    Raises
    ------
    BsaError
        If another process is writing this journal, or it was written by newer code.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / FILE_NAME
        self.warnings: list[str] = []
        self._file = open(self.path, "a+b")  # noqa: SIM115  (held for the life of the run)
        if fcntl is not None:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                self._file.close()
                raise BsaError(
                    f"another process is writing {self.path}.", "wait for it, or choose another --out folder."
                ) from None
        self._drop_torn_line()

    def _drop_torn_line(self) -> None:
        self._file.seek(0)
        content = self._file.read()
        if content and not content.endswith(b"\n"):
            keep = content.rfind(b"\n") + 1
            self._file.truncate(keep)
            self.warnings.append(f"{self.path}: dropped a torn last line of {len(content) - keep} bytes.")

    def append(self, event: str, **fields: Any) -> None:
        """Write one event and wait until it is on disk."""
        line = json.dumps({"event": event, **fields}, ensure_ascii=False, separators=(",", ":"))
        self._file.write(line.encode("utf-8", errors="replace") + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def read_events(folder: Path) -> Iterator[dict[str, Any]]:
    """The events of a run, oldest first; a torn last line is passed over.

    Raises
    ------
    BsaError
        If there is no journal, it is damaged, or it was written by newer code.
    """
    path = folder / FILE_NAME
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError:
        raise BsaError(
            f"{folder} holds no run ({FILE_NAME} is missing).", "give the folder of an earlier run."
        ) from None
    for number, line in enumerate(lines[:-1], start=1):
        try:
            event = json.loads(line)
            if not isinstance(event, dict) or "event" not in event:
                raise ValueError("not an event")
        except ValueError:
            raise BsaError(f"{path} is damaged at line {number}.", "restore the file, or start a new run.") from None
        if number == 1 and event.get("format", 0) > FORMAT:
            raise BsaError(
                f"{path} has format {event['format']}, this version reads up to {FORMAT}.",
                "upgrade battery-sim-agent.",
            )
        yield event
