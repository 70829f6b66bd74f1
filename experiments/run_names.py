"""What a run and its folder are called."""

from collections.abc import Sequence
from pathlib import Path

from ..core.record import Record
from ..core.spectrum import ImpedanceSpectrum


def numbered_folder(parent: Path, name: str) -> Path:
    """A folder that does not exist yet: ``name-1``, ``name-2``, ..."""
    safe = "".join(character if character.isalnum() or character in "-_." else "-" for character in name)
    number = 1
    while (parent / f"{safe}-{number}").exists():
        number += 1
    return parent / f"{safe}-{number}"


def named_after(sources: Sequence[Path | Record | ImpedanceSpectrum]) -> str:
    """The first record's name, and how many more there are."""
    first = sources[0]
    name = Path(first.name if isinstance(first, Record | ImpedanceSpectrum) else first).stem[:60]
    return name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")
