"""What a run and its folder are called."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from ..core.files import file_error, gone_if_empty
from ..core.record import Record
from ..core.spectrum import ImpedanceSpectrum


def numbered_folder(parent: Path, name: str) -> Path:
    """A folder that does not exist yet: ``name-1``, ``name-2``, ..."""
    safe = "".join(character if character.isalnum() or character in "-_." else "-" for character in name)
    folders = (parent / f"{safe}-{number}" for number in count(1))
    return next(folder for folder in folders if not folder.exists())


@contextmanager
def reserved_folder(parent: Path, name: str) -> Iterator[Path]:
    """As `numbered_folder`, made at once, so that nobody else is given it; it goes again if nothing is put into it.

    Raises `BsaError` if it cannot be made.
    """
    try:
        parent.mkdir(parents=True, exist_ok=True)
        while True:
            folder = numbered_folder(parent, name)
            with suppress(FileExistsError):  # somebody else was quicker
                folder.mkdir()
                break
    except OSError as error:
        raise file_error(error, parent) from None
    with gone_if_empty((folder,)):
        yield folder


def named_after(sources: Sequence[Path | Record | ImpedanceSpectrum]) -> str:
    """The first record's name, and how many more there are."""
    first = sources[0]
    name = Path(first.name if isinstance(first, Record | ImpedanceSpectrum) else first).stem[:60]
    return name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")
