"""How far a discovery has come: a line for each candidate effect, and the time that is left at most."""

import threading
import time
from collections.abc import Callable

from .findings import Listener, Nomination


class Progress:
    """Tells of candidates as their short fits end; threads may share it."""

    def __init__(self, say: Listener, clock: Callable[[], float] = time.monotonic) -> None:
        self._say = say
        self._clock = clock
        self._began = clock()
        self._lock = threading.Lock()
        self._done = self._total = 0
        self._phase_began = self._began

    def estimate(self, simulated: float, left: int) -> None:
        """Say how many simulations the fits at hand take, and how long at the pace of those made since this began.

        Nothing is said where there are none: other fits follow. More may follow in any case.
        """
        if not left:
            return
        seconds = (self._clock() - self._began) / simulated * left if simulated else None
        pace = "" if seconds is None else f": {duration(seconds)} at the present pace"
        self._say(f"at most {left} simulation{'s' * (left != 1)} until these are compared{pace}; more may follow")

    def begin(self, total: int) -> None:
        """Begin to fit so many candidates."""
        self._done, self._total, self._phase_began = 0, total, self._clock()

    def refitted(self, nomination: Nomination, base_cost: float) -> None:
        """One of them has its short fit: say what that leaves."""
        found = nomination.screened
        left = "cannot be fitted" if found is None else f"leaves {nomination.promise / base_cost:.0%} of the misfit"
        self.ended(nomination.effect.key, left)

    def ended(self, candidate: str, outcome: str) -> None:
        """One of them is done: say what came of it, and how long the others will take."""
        with self._lock:
            self._done += 1
            left = self._total - self._done
            seconds = (self._clock() - self._phase_began) / self._done * left
        rest = f", {duration(seconds)} left" if left else ""
        self._say(f"  {candidate}: {outcome} ({self._done} of {self._total}{rest})")


def duration(seconds: float) -> str:
    """A time as a person says it: ``about 2 min``."""
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"
