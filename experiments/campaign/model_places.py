"""A limit on calls of one model server, over all processes that share a store."""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from pathlib import Path

from filelock import FileLock, Timeout

from ...core.messages import Backend, JsonSchema, Message, Reply
from ...core.run.recording import BackendAround, Recorder

_FIRST_WAIT_S, _LONGEST_WAIT_S = 0.02, 1.0


class SharedBackend(BackendAround):
    """A backend whose calls wait for one of a few places.

    The places are files held by the calling process: no server keeps count, and a place that a killed worker held is
    free at once. ``folder`` holds them, the same for every process.
    """

    def __init__(self, inner: Backend, folder: Path, places: int) -> None:
        super().__init__(inner)
        self._folder = folder
        self._places = places

    def recorded_by(self, recorder: Recorder) -> SharedBackend:
        """See `bsa.core.run.recording.Layer`: a place is held as long as a round's votes take."""
        return SharedBackend(recorder.around(self._inner), self._folder, self._places)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`; waits for a place first."""
        wait_s = _FIRST_WAIT_S
        while True:
            # From a random place, so that processes do not all contend for the first one.
            start = random.randrange(self._places)
            for turn in range(self._places):
                lock = FileLock(self._folder / str((start + turn) % self._places), timeout=0)
                try:
                    place = lock.acquire()
                except Timeout:
                    continue
                with place:
                    return self._inner.complete(messages, schema, seed=seed)
            time.sleep(wait_s * random.uniform(0.5, 1.5))
            wait_s = min(2 * wait_s, _LONGEST_WAIT_S)
