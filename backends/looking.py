"""A short look at a server: whether it answers, and what it lists."""

import os
from functools import cache
from typing import Any, NamedTuple

import httpx

from .api_keys import key_remedy
from .bounded_http import OwnServerTransport
from .deadline import within
from .reaching import connection_failure
from .retrying import UnreachableError

_LOOK_TIMEOUT_S = 0.8


class Look(NamedTuple):
    """What a server answered."""

    content: Any  # The JSON; None where something is wrong.
    problem: str = ""  # What is wrong.
    remedy: str = ""  # What would change it, where that is not to start the server.
    # Whether no server is there: one that is slow, or lists nothing, may answer all the same.
    unreachable: bool = False


def look(address: str, key_variable: str | None) -> Look:
    """Look at an address."""
    key = os.environ.get(key_variable or "") or None
    return _look_once(address, key, key_remedy(key_variable) if key_variable else "", os.getpid())


@cache
def _look_once(address: str, key: str | None, remedy: str, _process: int) -> Look:
    def ask() -> httpx.Response:
        with httpx.Client(transport=OwnServerTransport(key), timeout=_LOOK_TIMEOUT_S) as client:
            return client.get(address)

    try:
        response = within(_LOOK_TIMEOUT_S, ask)
        if response.status_code in (401, 403):
            return Look(None, f"does not accept {'the key' if key else 'a call without a key'}", remedy)
        if response.status_code != 200:
            return Look(None, f"answers with HTTP status {response.status_code}")
        return Look(response.json())
    except (httpx.TimeoutException, TimeoutError):
        return Look(None, f"does not answer within {_LOOK_TIMEOUT_S} s")
    except httpx.RequestError as error:
        failure = connection_failure(error)
        if not isinstance(failure, UnreachableError):
            return Look(None, f"does not answer ({failure})")
        # Where the connection is refused, the address may be right and the server not started.
        remedy = "" if failure.refused else f"{failure.hint}."
        return Look(None, f"does not answer ({failure.what})", remedy, unreachable=True)
    except (ValueError, RecursionError):
        return Look(None, "answers with something else than JSON")


def forget_looks() -> None:
    """Look again next time: servers come and go."""
    _look_once.cache_clear()
