"""A listener that tells how many simulations were made where nothing else is said for long."""

import threading
import time
from collections.abc import Callable

_SILENT_S = 15.0
"""Time without a line, s, after which the number of simulations is told: the base model alone takes minutes to fit."""


class ToldSimulations:
    """Hands lines on to ``say``, and tells the number of simulations between them; threads may share it."""

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._say, self._clock = say, clock
        self._lock = threading.Lock()
        self._said, self._made = clock(), 0

    def __call__(self, text: str) -> None:
        """Say a line."""
        with self._lock:
            self._said = self._clock()
            self._say(text)

    def simulated(self, count: int) -> None:
        """So many more simulations were made."""
        with self._lock:
            self._made += count
            if self._clock() - self._said >= _SILENT_S:
                self._said = self._clock()
                self._say(f"  {self._made} simulations so far")
