"""A short look at a server: whether it answers, and what it lists."""

import os
from functools import cache
from typing import Any, NamedTuple

import httpx

from .bounded_http import OwnServerTransport
from .deadline import within
from .reaching import connection_failure
from .retrying import UnreachableError

_LOOK_TIMEOUT_S = 0.8


class Look(NamedTuple):
    """What a server answered."""

    content: Any  # The JSON; None where something is wrong.
    problem: str = ""  # What is wrong.
    unreachable: bool = (
        False  # Whether no server is there: one that is slow, or lists nothing, may answer all the same.
    )


def look(address: str, key_variable: str | None) -> Look:
    """Look at an address."""
    return _look_once(address, os.environ.get(key_variable or ""), os.getpid())


@cache
def _look_once(address: str, key: str | None, _process: int) -> Look:
    def ask() -> httpx.Response:
        with httpx.Client(transport=OwnServerTransport(key), timeout=_LOOK_TIMEOUT_S) as client:
            return client.get(address)

    try:
        response = within(_LOOK_TIMEOUT_S, ask)
        if response.status_code != 200:
            return Look(None, f"answers with HTTP status {response.status_code}")
        return Look(response.json())
    except (httpx.TimeoutException, TimeoutError):
        return Look(None, f"does not answer within {_LOOK_TIMEOUT_S} s")
    except httpx.RequestError as error:
        failure = connection_failure(error)
        return Look(None, f"does not answer ({failure})", isinstance(failure, UnreachableError))
    except (ValueError, RecursionError):
        return Look(None, "answers with something else than JSON")


def forget_looks() -> None:
    """Look again next time: servers come and go."""
    _look_once.cache_clear()
