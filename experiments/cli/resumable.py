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
    written = max(_events(folder), 1)
    try:
        yield
    except BsaError as error:
        if _events(folder) <= written:
            raise
        raise BsaError(error.message, f"{_sentence(error.hint)}Then go on with: {command}") from error


def _events(folder: Path) -> int:
    path = folder / FILE_NAME
    if not path.is_file():
        return 0
    with path.open("rb") as lines:
        return sum(1 for _ in lines)


def _sentence(hint: str) -> str:
    """A hint with its end, before another sentence; empty where there is none."""
    return f"{hint}{'' if hint.endswith(('.', '?')) else '.'} " if hint else ""
