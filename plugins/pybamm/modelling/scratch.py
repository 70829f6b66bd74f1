"""Temporary folders of a process, and their removal where it was ended and could not do so itself."""

import os
import shutil
import tempfile
from pathlib import Path


def scratch_folder() -> tempfile.TemporaryDirectory[str]:
    """A temporary folder of this process."""
    return tempfile.TemporaryDirectory(prefix=_prefix(os.getpid()), ignore_cleanup_errors=True)


def remove_scratch_of(pid: int) -> None:
    """Remove the folders that a process which has ended left behind."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_prefix(pid)}*"):
        shutil.rmtree(folder, ignore_errors=True)


def _prefix(pid: int) -> str:
    return f"bsa-{pid}-"
