import itertools
import random
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime

import pytest
from bsa.backends import retrying
from bsa.backends.retrying import Persistence, TransientError, retry_after
from bsa.core.messages import BackendFailure


def test_what_a_server_asks_for():
    assert retry_after({"retry-after": "2.5"}) == 2.5
    assert retry_after({"retry-after-ms": "300", "retry-after": "9"}) == 0.3
    later = format_datetime(datetime.now(UTC) + timedelta(seconds=30), usegmt=True)
    assert 25 < retry_after({"retry-after": later}) <= 30
    assert retry_after({"retry-after": "-5"}) == 0
    for headers in (None, {}, {"retry-after": "soon"}):
        assert retry_after(headers) is None


@pytest.fixture
def clock(monkeypatch):
    """Time that passes only by sleeping."""
    now = [0.0]
    monkeypatch.setattr(retrying.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(retrying.time, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    return now


def test_attempts_stay_within_the_limit(clock):
    notes, allowed = [], []

    def attempt(seconds):
        allowed.append(seconds)
        clock[0] += seconds
        raise TransientError("stalled")

    with pytest.raises(BackendFailure, match="stalled"):
        Persistence(timeout_s=10, limit_s=25, notes=notes, jitter=random.Random(0)).call(attempt)
    assert clock[0] <= 25
    assert allowed[0] == 10
    assert len(notes) == len(allowed) - 1


def test_one_limit_covers_all_calls(clock):
    persistence = Persistence(timeout_s=10, limit_s=5, notes=[], jitter=random.Random(0))
    clock[0] = 6
    assert persistence.call(lambda allowed: allowed) == 10
    with pytest.raises(BackendFailure, match="time is up"):
        persistence.call(lambda allowed: allowed)


def test_waits_grow(clock):
    starts = []

    def attempt(allowed):
        starts.append(clock[0])
        raise TransientError("busy")

    with pytest.raises(BackendFailure, match="8 attempts"):
        Persistence(timeout_s=1, limit_s=1000, notes=[], jitter=random.Random(0)).call(attempt)
    waits = [later - earlier for earlier, later in itertools.pairwise(starts)]
    assert len(waits) == 7
    assert all(0.5 * 2**index <= wait <= 2**index for index, wait in enumerate(waits[:6]))
