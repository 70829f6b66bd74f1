"""A short look at a server: whether it answers, and what it lists."""

import os
from functools import cache
from typing import Any

import httpx

from .bounded_http import OwnServerTransport
from .deadline import within
from .reaching import connection_failure

_LOOK_TIMEOUT_S = 0.8


def look(address: str, key_variable: str | None) -> tuple[Any, str]:
    """The JSON at an address and an empty string, or None and what is wrong."""
    return _look_once(address, os.environ.get(key_variable or ""), os.getpid())


@cache
def _look_once(address: str, key: str | None, _process: int) -> tuple[Any, str]:
    def ask() -> httpx.Response:
        with httpx.Client(transport=OwnServerTransport(key), timeout=_LOOK_TIMEOUT_S) as client:
            return client.get(address)

    try:
        response = within(_LOOK_TIMEOUT_S, ask)
        if response.status_code != 200:
            return None, f"answers with HTTP status {response.status_code}"
        return response.json(), ""
    except (httpx.TimeoutException, TimeoutError):
        return None, f"does not answer within {_LOOK_TIMEOUT_S} s"
    except httpx.RequestError as error:
        return None, f"does not answer ({connection_failure(error)})"
    except (ValueError, RecursionError):
        return None, "answers with something else than JSON"


def forget_looks() -> None:
    """Look again next time: servers come and go."""
    _look_once.cache_clear()
