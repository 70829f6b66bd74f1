"""Work whose simulations stand in a journal, also when something ends it with an error."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...core.errors import BsaError
from ...core.run.journal import FILE_NAME


@contextmanager
def resumable(folder: Path, command: str) -> Iterator[None]:
    """End the hint of an error with the command that goes on, where the journal in ``folder`` has grown before it.

    Its first event says only what was asked.
    """
    written = _journal_size(folder)
    try:
        yield
    except BsaError as error:
        if _journal_size(folder) <= max(written, _first_event_size(folder)):
            raise
        raise BsaError(error.message, f"{_sentence(error.hint)}Then go on with: {command}") from error


def _journal_size(folder: Path) -> int:
    path = folder / FILE_NAME
    return path.stat().st_size if path.is_file() else 0


def _first_event_size(folder: Path) -> int:
    path = folder / FILE_NAME
    if not path.is_file():
        return 0
    with path.open("rb") as lines:
        return len(lines.readline())


def _sentence(hint: str) -> str:
    """A hint with its end, before another sentence; empty where there is none."""
    return f"{hint}{'' if hint.endswith(('.', '?')) else '.'} " if hint else ""
