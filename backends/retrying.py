"""Tries again what may pass by itself: time-outs, rate limits, server errors, cut connections."""

import random
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import TypeVar

from ..core.messages import BackendFailure, BackendUnreachable
from ..core.printable import counted

T = TypeVar("T")

_MAX_ATTEMPTS = 8
_MAX_ATTEMPTS_UNREACHED = 3
"""Attempts, within about three seconds, at a server out of reach: its address is most likely wrong. One that has
answered before may be starting again; a run asks it once more after minutes, or stops and goes on later."""
_FIRST_WAIT_S = 1.0
_LONGEST_WAIT_S = 60.0


class TransientError(Exception):
    """A failure that may pass by itself.

    ``retry_after_s`` is when the server asked to be tried again; ``server_fault`` whether the server itself failed over
    the request (HTTP 500), rather than being busy or out of reach.
    """

    def __init__(self, reason: str, retry_after_s: float | None = None, server_fault: bool = False) -> None:
        super().__init__(reason)
        self.reason = reason
        self.retry_after_s = retry_after_s
        self.server_fault = server_fault


class UnreachableError(TransientError):
    """There is no connection to the server, or none that makes sense.

    ``may_pass`` is whether that can pass by itself: a server may be starting, but a wrong scheme stays wrong.
    ``refused`` is whether the machine is there, and nothing listens at its port.
    """

    def __init__(self, reason: str, hint: str, may_pass: bool = False, refused: bool = False) -> None:
        super().__init__(f"{reason}; {hint}")
        self.what = reason
        self.hint = hint
        self.may_pass = may_pass
        self.refused = refused


class Persistence:
    """Attempts a call until it works; one for each reply, however many forms its request takes.

    Parameters
    ----------
    timeout_s : float
        Longest wait for one attempt, s.
    limit_s : float
        No further attempt begins, or lasts, later than this from now, s.
    notes : list of str
        Gets every further attempt.
    jitter : random.Random
        Spreads the waits, so that many runs do not come back at the same moment.
    say : callable
        Is told of every further attempt before its wait.
    """

    def __init__(
        self,
        timeout_s: float,
        limit_s: float,
        notes: list[str],
        jitter: random.Random,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._timeout_s, self._limit_s = timeout_s, limit_s
        self._notes = notes
        self._jitter = jitter
        self._say = say
        self._started = time.monotonic()
        self._attempts = 0

    @property
    def _left_s(self) -> float:
        return self._limit_s - (time.monotonic() - self._started)

    def call(self, attempt: Callable[[float], T]) -> T:
        """Attempt until it works.

        ``attempt`` is given the seconds it may take, and raises `TransientError` for what is worth another try. Raises
        `BackendUnreachable` when there is no connection to the server, and `BackendFailure` when a limit is reached.
        """
        for number in range(1, _MAX_ATTEMPTS + 1):
            # The first attempt is not cut short by the limit, which is on trying again.
            allowed = self._timeout_s if self._attempts == 0 else min(self._timeout_s, self._left_s)
            if allowed <= 0:
                raise self._given_up(TransientError("the time is up"))
            self._attempts += 1
            try:
                return attempt(allowed)
            except TransientError as failure:
                wait = failure.retry_after_s
                if wait is None:
                    wait = min(_FIRST_WAIT_S * 2 ** (number - 1), _LONGEST_WAIT_S) * self._jitter.uniform(0.5, 1.0)
                if number >= self._most(failure) or wait >= self._left_s:
                    raise self._given_up(failure) from None
                told = f"attempt {self._attempts}: {failure.reason}; tried again after {wait:.1f} s"
                self._notes.append(told)
                self._say(told)
                time.sleep(wait)
        raise AssertionError("the last attempt returns or raises")

    def _most(self, failure: TransientError) -> int:
        if isinstance(failure, UnreachableError):
            return _MAX_ATTEMPTS_UNREACHED if failure.may_pass else 1
        return _MAX_ATTEMPTS

    def _given_up(self, failure: TransientError) -> BackendFailure:
        tries = counted(self._attempts, "attempt")
        if isinstance(failure, UnreachableError):
            return BackendUnreachable(f"not reached in {tries}: {failure.reason}")
        return BackendFailure(f"no reply after {tries}, {self._limit_s:g} s allowed: {failure.reason}")


def retry_after(headers: Mapping[str, str] | None) -> float | None:
    """The wait that a server's headers ask for, in seconds; None if they do not."""
    if headers is None:
        return None
    for name, unit in (("retry-after-ms", 1e-3), ("retry-after", 1.0)):
        value = headers.get(name)
        if value is None:
            continue
        try:
            return max(0.0, float(value) * unit)
        except ValueError:
            pass
        try:
            moment = parsedate_to_datetime(value)
        except (ValueError, TypeError, OverflowError):
            continue
        return max(0.0, (moment.astimezone(UTC) - datetime.now(UTC)).total_seconds())
    return None
