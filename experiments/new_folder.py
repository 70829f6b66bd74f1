"""A folder for results that is there, and can be written to, before the work begins."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..core.errors import BsaError
from ..core.files import entries, file_error, gone_if_empty


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Make a folder, or take an empty one, for what the block computes; it goes again if nothing comes into it.

    Raises `BsaError` before the block if the folder holds anything, or cannot be written to: simulations whose result
    has no place are lost.
    """
    if entries(folder):
        raise BsaError(f"{folder} is not empty; nothing was written.", "choose a new folder with --out.")
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    with gone_if_empty(made):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise file_error(error, folder) from None
        yield folder
