"""Optional libraries: imported where they are used, and asked for by name where they are missing."""

from importlib import import_module
from types import ModuleType

from .errors import BsaError


def require(module: str, extra: str, purpose: str) -> ModuleType:
    """Import a module of an optional library.

    ``extra`` is that of this distribution which installs it, ``purpose`` what needs it, as the start of the message:
    ``'the proposer "bo"'``. Raises `BsaError` if it is not installed, with the exact line that installs it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        missing = (error.name or module).split(".")[0]
        if missing != module.split(".")[0]:
            raise  # the library is there and broken: that is not for us to explain away
        raise BsaError(
            f"{purpose} needs {missing}, which is not installed.", f'pip install "battery-sim-agent[{extra}]"'
        ) from None
