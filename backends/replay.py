"""The replies of an earlier run, given again without a model."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.errors import BsaError
from ..core.journal import FILE_NAME, read_events
from ..core.messages import BackendFailure, BudgetSpent, JsonSchema, Message, Reply, Usage
from ..core.recording import LOST_CALL, REPLY


class ReplayBackend:
    """Gives recorded replies in order, lost calls included.

    Tokens and cost are the original run's, so that its report comes out the same.

    Parameters
    ----------
    events : iterable of mapping
        A journal's events; only replies and lost calls count.
    name : str
        The backend's name.
    """

    sees_images = False

    def __init__(self, events: Iterable[Mapping[str, Any]], name: str) -> None:
        self.name = name
        self._events = deque(event for event in events if event["event"] in (REPLY, LOST_CALL))
        self._count = len(self._events)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`.

        Raises
        ------
        BudgetSpent
            When no reply is left, so that the run stops cleanly where the original did.
        """
        if not self._events:
            raise BudgetSpent(f"all {self._count} replies of {self.name} have been given")
        event = self._events.popleft()
        if event["event"] == LOST_CALL:
            raise BackendFailure(str(event.get("reason", "")))
        usage = {key: value for key, value in event.get("usage", {}).items() if key in Usage.__dataclass_fields__}
        return Reply(
            text=str(event.get("text", "")),
            usage=Usage(**usage),
            model=str(event.get("model", "")),
            structured_by=event.get("structured_by", "text"),
            notes=tuple(event.get("notes", ())),
        )

    def close(self) -> None:
        """Nothing to release."""


def replay(run: str) -> ReplayBackend:
    """The replies of a run's journal.

    Parameters
    ----------
    run : str
        The run's folder, its journal, or its name below ``runs/``.

    Raises
    ------
    BsaError
        If there is no such run, or it asked no model.
    """
    given = Path(run)
    folder = given.parent if given.name == FILE_NAME else given
    if not (folder / FILE_NAME).is_file() and ("runs" / given / FILE_NAME).is_file():
        folder = "runs" / given
    backend = ReplayBackend(read_events(folder), f"replay:{run}")
    if not backend._count:
        raise BsaError(f"the run {folder} holds no reply of a model.", "replay a run whose scaffold asks one.")
    return backend
