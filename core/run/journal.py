"""A run on disk: an append-only journal from which it can be resumed, redrawn and audited."""

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BsaError
from ..files import begins, entries, file_error, foreign

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no flock; there a second writer is not noticed
    fcntl = None  # type: ignore[assignment]

FORMAT = 1
FILE_NAME = "journal.jsonl"
LOCK = "lock"
"""Lock file of a process of a campaign in a run's folder, before there is a journal in it."""

_BEGINNING = b'{"event":"run"'
"""How every journal begins; a file that begins otherwise is not ours."""

Event = Mapping[str, Any]


class Journal:
    """Appends events to ``journal.jsonl``, each on disk before the run goes on.

    The run's folder is made if missing. Raises `BsaError` if it holds something that is not a run, another process is
    writing this journal, or it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._opened = time.perf_counter()
        check_run_folder(folder)
        self.path = folder / FILE_NAME
        self.warnings: list[str] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0)
            # Unbuffered: what the disk refuses must not be written later, behind a torn line.
            self._file = open(os.open(self.path, flags, 0o666), "r+b", buffering=0)  # noqa: SIM115  (held for the run)
        except OSError as error:
            raise file_error(error, self.path) from None
        if fcntl is not None:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(self._file.fileno()).st_nlink == 0:
                    raise OSError("its last holder has just removed it")
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

    @property
    def open_s(self) -> float:
        """Time since it was opened, s."""
        return time.perf_counter() - self._opened

    def append(self, event: str, **fields: Any) -> None:
        """Write one event and wait until it is on disk.

        Raises `BsaError` if it cannot be written; the journal then ends with the event before, and the run can be
        resumed.
        """
        line = json.dumps({"event": event, **fields}, ensure_ascii=False, separators=(",", ":"))
        left = line.encode("utf-8", errors="replace") + b"\n"
        size = os.fstat(self._file.fileno()).st_size
        try:
            while left:
                left = left[self._file.write(left) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(size)
            raise file_error(error, self.path) from None

    def clear(self) -> None:
        """Forget every event."""
        self._file.truncate(0)

    def close(self) -> None:
        """Let go of the file; a journal without an event goes, and its folder if nothing else is in it."""
        if os.fstat(self._file.fileno()).st_size == 0:
            with suppress(OSError):
                self.path.unlink()
                self.path.parent.rmdir()
        self._file.close()


@dataclass(frozen=True)
class OpenJournal:
    """The journal of a run or a discovery that is under way."""

    file: Journal  # Open for writing.
    earlier: list[dict[str, Any]]  # Events from before it was stopped; none of a new one.

    @property
    def wall_s(self) -> float:
        """Time so far, of each time that it was taken up, s."""
        return spent_s(self.earlier) + self.file.open_s


@contextmanager
def opened(folder: Path, simulation: str) -> Iterator[OpenJournal]:
    """The journal in a folder; ``simulation`` is the kind of event that holds one."""
    file = Journal(folder)
    earlier: list[dict[str, Any]] = []
    try:
        earlier += list(read_events(folder))
        yield OpenJournal(file, earlier)
    except BsaError:
        # Refused before its first simulation: what is left must not block the folder for the mended command.
        simulated = any(event["event"] == simulation for event in read_events(folder))
        if not earlier and not simulated and not any(path.is_dir() for path in folder.iterdir()):
            file.clear()
        raise
    finally:
        file.close()


def spent_s(events: Iterable[Event]) -> float:
    """Time that events tell of, s: each time that a run was taken up counts up to the last event that has one.

    That is its end, or, where it was killed, a simulation of a discovery.
    """
    total = since = 0.0
    for event in events:
        since = float(event.get("wall_s", since))
        if event["event"] in ("end", "resumed"):
            total, since = total + since, 0.0
    return total + since


def check_run_folder(folder: Path) -> None:
    """Refuse a folder that holds anything else than a run; nothing is written.

    Raises `BsaError` if there are files without a journal, or a journal that is not ours.
    """
    found = entries(folder)
    if FILE_NAME not in found:
        if found and LOCK not in found:
            raise foreign(folder, "a run")
        return
    # A run that was killed while it began has part of the first line.
    if not begins(folder / FILE_NAME, _BEGINNING):
        raise foreign(folder / FILE_NAME, "the journal of a run")


def check_calibration(
    first: Event, path: Path, with_a_discovery: str = "bsa discover --resume goes on with it."
) -> None:
    """Refuse a journal whose first event is not that of a calibration.

    Raises `BsaError`; where it is that of a discovery, the hint is what can be done with one.
    """
    if first.get("kind") == "discovery":
        raise BsaError(f"{path} is the journal of a discovery.", with_a_discovery)
    if first.get("event") != "run" or "task" not in first:
        raise BsaError(f"{path} does not begin with a run.", "give the folder of an earlier run.")


def read_events(folder: Path) -> Iterator[dict[str, Any]]:
    """The events of a run, oldest first; a torn last line is passed over.

    Raises `BsaError` if there is no journal, it is damaged, or it was written by newer code.
    """
    from .event_shapes import check_event  # needs numpy, which `bsa --help` does not

    path = folder / FILE_NAME
    if not path.is_file():
        raise BsaError(f"{folder} holds no run ({FILE_NAME} is missing).", "give the folder of an earlier run.")
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise file_error(error, path) from None
    for number, line in enumerate(lines[:-1], start=1):
        try:
            event = json.loads(line)
            if not isinstance(event, dict) or not isinstance(event.get("event"), str):
                raise ValueError("not an event")
            version = event.get("format", 0) if number == 1 else 0
            if not isinstance(version, int):
                raise ValueError("no number")
            if version <= FORMAT:
                check_event(event["event"], line)
        except (ValueError, RecursionError) as error:
            raise BsaError(
                f"{path} is damaged at line {number} ({str(error) or 'too deep'}).",
                "restore the file, or start a new run.",
            ) from None
        if version > FORMAT:
            raise BsaError(
                f"{path} has format {version}, this version reads up to {FORMAT}.",
                "upgrade battery-sim-agent.",
            )
        yield event
