"""How far a discovery has come: a line for each candidate effect, and how long the fits at hand take at most."""

import threading
import time
from collections.abc import Callable

from ..printable import counted, duration
from .findings import Listener


class Progress:
    """Tells of candidates as their short fits end; threads may share it."""

    def __init__(self, say: Listener, clock: Callable[[], float] = time.monotonic) -> None:
        self._say = say
        self._clock = clock
        self._began = clock()
        self._lock = threading.Lock()
        self._done = self._total = 0

    def estimate(self, simulated: float, remaining: int) -> None:
        """Say how many simulations the fits at hand take, and how long at the pace of those made since this began.

        Nothing is said where there are none: other fits follow. More may follow in any case.
        """
        if not remaining:
            return
        seconds = (self._clock() - self._began) / simulated * remaining if simulated else None
        pace = "" if seconds is None else f": {duration(seconds)} at the present pace"
        self._say(f"at most {counted(remaining, 'simulation')} until these are compared{pace}; more may follow")

    def begin(self, total: int) -> None:
        """Begin to fit so many candidates."""
        self._done, self._total = 0, total

    def ended(self, candidate: str, outcome: str) -> None:
        """One of them is done: say what came of it.

        Not how long the others take: fits differ in length, and those that a journal answers take none.
        """
        with self._lock:
            self._done += 1
            place = self._done
        self._say(f"  {candidate}: {outcome} ({place} of {self._total})")
