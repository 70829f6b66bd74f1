"""Tries again what may pass by itself: time-outs, rate limits, server errors, cut connections."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import TypeVar

from ..core.messages import BackendFailure

T = TypeVar("T")

_MAX_ATTEMPTS = 8
_FIRST_WAIT_S = 1.0
_LONGEST_WAIT_S = 60.0


class TransientError(Exception):
    """A failure that may pass by itself.

    Parameters
    ----------
    reason : str
        What happened, for the journal.
    retry_after_s : float, optional
        When the server asked to be tried again.
    """

    def __init__(self, reason: str, retry_after_s: float | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.retry_after_s = retry_after_s


@dataclass(frozen=True)
class Patience:
    """How long a call may take.

    Attributes
    ----------
    timeout_s : float
        Longest wait for one attempt.
    limit_s : float
        No further attempt begins, or lasts, later than this after the first began.
    """

    timeout_s: float
    limit_s: float


def persist(attempt: Callable[[float], T], patience: Patience, notes: list[str], jitter: random.Random) -> T:
    """Attempt until it works.

    Parameters
    ----------
    attempt : callable
        Is given the seconds it may take; raises `TransientError` for what is worth another try.
    patience : Patience
        The limits.
    notes : list of str
        Is told of every further attempt.
    jitter : random.Random
        Spreads the waits, so that many runs do not come back at the same moment.

    Raises
    ------
    BackendFailure
        When the limit is reached.
    """
    started = time.monotonic()
    for number in range(1, _MAX_ATTEMPTS + 1):
        left = patience.limit_s - (time.monotonic() - started)
        allowed = patience.timeout_s if number == 1 else min(patience.timeout_s, left)
        try:
            return attempt(allowed)
        except TransientError as failure:
            wait = failure.retry_after_s
            if wait is None:
                wait = min(_FIRST_WAIT_S * 2 ** (number - 1), _LONGEST_WAIT_S) * jitter.uniform(0.5, 1.0)
            left = patience.limit_s - (time.monotonic() - started)
            if number == _MAX_ATTEMPTS or wait >= left:
                tries = f"{number} attempt{'s' * (number > 1)}"
                raise BackendFailure(
                    f"no reply after {tries}, {patience.limit_s:g} s allowed: {failure.reason}"
                ) from None
            notes.append(f"attempt {number}: {failure.reason}; tried again after {wait:.1f} s")
            time.sleep(wait)
    raise AssertionError("the last attempt returns or raises")


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
        except ValueError:
            continue
        return max(0.0, (moment.astimezone(UTC) - datetime.now(UTC)).total_seconds())
    return None
