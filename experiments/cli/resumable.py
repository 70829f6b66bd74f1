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
    path = folder / FILE_NAME
    written = path.stat().st_size if path.is_file() else 0
    try:
        yield
    except BsaError as error:
        if not path.is_file():
            raise
        with path.open("rb") as lines:
            first_event = len(lines.readline())
        if path.stat().st_size <= max(written, first_event):
            raise
        raise BsaError(error.message, f"{_sentence(error.hint)}Then go on with: {command}") from error


def _sentence(hint: str) -> str:
    """A hint with its end, before another sentence; empty where there is none."""
    return f"{hint}{'' if hint.endswith(('.', '?')) else '.'} " if hint else ""
