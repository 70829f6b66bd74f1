"""The language model of a run that is about to start."""

from collections.abc import Mapping
from typing import Any

from ..backends.opening import look_before, open_backend
from ..core.messages import Backend


def ready_backend(spec: str, options: Mapping[str, Any], begun: bool) -> tuple[Backend, str]:
    """A model that was opened and looked at, and a note where it may not answer.

    A run that was ``begun`` is not looked at: its journal may hold every reply that it needs. Raises `BsaError` if it
    cannot be opened, or nothing is there that could answer.
    """
    backend = open_backend(spec, options)
    if begun:
        return backend, ""
    try:
        return backend, look_before(spec, options)
    except BaseException:
        backend.close()
        raise
