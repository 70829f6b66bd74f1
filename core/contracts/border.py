"""The border between this package and its plugins: whatever goes wrong beyond it names the plugin, in one line."""

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BsaError, SamplesError
from ..messages import BackendFailure, RunStopped
from ..printable import shown

_OURS = (KeyboardInterrupt, BsaError, BackendFailure, RunStopped)
"""What a plugin may raise on purpose, or merely lets pass."""

_MOST_CHARACTERS = 300


class Unfit(Exception):
    """What a plugin gave is not what its hook promises.

    ``what`` is the rest of a sentence that begins with the hook: ``"returned None, not a Feedback"``.
    """

    def __init__(self, what: str, hint: str = "") -> None:
        super().__init__(what)
        self.hint = hint


@contextmanager
def border(who: str, hook: str) -> Iterator[None]:
    """Name the plugin in whatever its code raises, or its products lack, inside the block.

    Ctrl-C, a stopped run, a lost call and a `BsaError` pass as they are, but for one of samples of which no trajectory
    can be made: here they are the plugin's and not the user's. Everything else is caught, `SystemExit`
    included: a plugin does not end the process. ``who`` is kind, name, distribution and version, ``"memory notebook of
    my-plugin 0.1"``, ``hook`` what it was called for, ``"remember"``. Raises `BsaError`: ``memory notebook of my-plugin
    0.1: boom in remember``.
    """
    try:
        yield
    except SamplesError as error:
        hint = f"every sample has a finite number, at a time that does not fall; {_where(error)}; tell its authors."
        raise BsaError(f"{who}: {hook} gave samples that make no trajectory: {error.message}", hint) from error
    except _OURS:
        raise
    except Unfit as fault:
        raise BsaError(f"{who}: {hook} {fault}.", fault.hint) from fault
    except BaseException as error:
        # What `sys.exit` says may be a bare number.
        kind = "SystemExit: " * isinstance(error, SystemExit)
        raise BsaError(f"{who}: {kind}{in_words(error)} in {hook}.", f"{_where(error)}; tell its authors.") from error


def in_words(error: BaseException) -> str:
    """What an exception says, on one line; its type where it says nothing."""
    try:
        said = str(error).strip()
    except Exception:  # an exception of a plugin is a plugin's code as well
        said = ""
    return shown(said.splitlines()[0], _MOST_CHARACTERS) if said else type(error).__name__


def _where(error: BaseException) -> str:
    """``RuntimeError at notebook.py, line 12``: the innermost place that the exception came through."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{place}"
