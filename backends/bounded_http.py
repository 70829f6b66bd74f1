"""Carries every request to a server: bounded in time and size while it is read, and never on to another address."""

import re
import ssl
import time
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from urllib.request import getproxies, proxy_bypass

import httpcore
import httpx

from ..core.redaction import holds_key
from .addresses import is_private, is_this_machine

MAX_BODY_BYTES = 4 * 2**20
"""Longest answer that is read. A reply is kept up to 200,000 characters: at most 2.4 MB, each escaped as two
``\\uXXXX``; the rest is for reasoning and accounts."""
_LONGEST_ANSWER_S = 300.0
"""Where a client sets no time-out: as long as a backend waits unless it is told otherwise."""
_PIECE_BYTES = 2**16
_TLS_ALERT = b"\x15\x03"
_HTTP = b"HTTP/"
_MEANT_FOR_TLS = re.compile(rb"HTTP request (was sent )?to (an )?HTTPS (port|server)", re.IGNORECASE)
_OWN_HEADERS = ("host", "accept", "content-type", "content-length", "user-agent")


class TooLongError(httpx.RequestError):
    """The answer is longer than `MAX_BODY_BYTES`."""


class RedirectedError(httpx.RequestError):
    """The server points to another address, which must not be sent a key or a prompt meant for this one."""


class InTheClearError(httpx.RequestError):
    """The request would carry a hosted model's key past everybody on the way."""


class SpeaksTlsError(httpx.ConnectError):
    """The server answers a plain request in TLS, or asks for it."""


class NotHttpError(httpx.ConnectError):
    """What listens there speaks another protocol."""


class BoundedTransport(httpx.BaseTransport):
    """Sends a request over a connection of its own and reads the whole answer, within the request's read time-out.

    HTTP clients limit the wait for each byte, and not at all how many there are. Here the time-out bounds
    the whole exchange, from the connection to the last byte, so that the thread which waits ends with it; only
    the look-up of a host's name is left to the resolver's own limits.
    """

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """See `httpx.BaseTransport.handle_request`."""
        allowed_s = request.extensions.get("timeout", {}).get("read") or _LONGEST_ANSWER_S
        budget = _Budget(allowed_s)
        # A compressed answer could be small on the wire and without end in memory.
        ours = {"connection": "close", "accept-encoding": "identity"}
        asked = httpcore.Request(
            method=request.method,
            url=str(request.url),
            headers=[*(item for item in self._sent(request).items() if item[0] not in ours), *ours.items()],
            content=request.read(),
        )
        try:
            with _pool(request.url, budget) as pool:
                answer = pool.handle_request(asked)
                content = answer.read()
        except _NETWORK_ERRORS as error:
            # httpx names its errors as httpcore does.
            kind: type[httpx.RequestError] = getattr(httpx, type(error).__name__, httpx.NetworkError)
            raise kind(str(error), request=request) from error
        except httpx.RequestError as error:
            error.request = request
            raise
        if answer.status == 400 and _MEANT_FOR_TLS.search(content):
            raise SpeaksTlsError("the server wants TLS", request=request)
        headers = httpx.Headers(answer.headers)
        if 300 <= answer.status < 400:
            raise RedirectedError(f"redirects to {headers.get('location', 'nowhere')}", request=request)
        if headers.get("content-encoding", "identity").casefold() != "identity":
            raise httpx.DecodingError("the answer is compressed, which was not asked for", request=request)
        return httpx.Response(answer.status, headers=answer.headers, content=content, request=request)

    def _sent(self, request: httpx.Request) -> httpx.Headers:
        """The headers that are sent along."""
        sent = "\n".join((str(request.url), *request.headers.values()))
        if not is_private(str(request.url)) and holds_key(sent):
            raise InTheClearError(f"a provider's key is not sent to {request.url.host} unencrypted", request=request)
        return request.headers


class OwnServerTransport(BoundedTransport):
    """The same for a server of one's own, which gets the request, the one key meant for it, and nothing else.

    Client libraries add headers from the environment that are meant for a provider: keys, organisation, project. A user
    name and password in the server's address go before ``key``.
    """

    def __init__(self, key: str | None) -> None:
        self._key = key

    def _sent(self, request: httpx.Request) -> httpx.Headers:
        sent = httpx.Headers([(name, request.headers[name]) for name in _OWN_HEADERS if name in request.headers])
        login = request.headers.get("authorization", "")
        if login.startswith("Basic "):
            sent["authorization"] = login
        elif self._key:
            sent["authorization"] = f"Bearer {self._key}"
        return sent


_NETWORK_ERRORS = (httpcore.NetworkError, httpcore.TimeoutException, httpcore.ProtocolError, httpcore.ProxyError)


class _Budget:
    def __init__(self, allowed_s: float) -> None:
        self._deadline = time.monotonic() + allowed_s
        self._left = MAX_BODY_BYTES

    def seconds(self) -> float:
        left = self._deadline - time.monotonic()
        if left <= 0:
            raise httpcore.ReadTimeout("the time is up")
        return left

    def spend(self, count: int) -> None:
        self._left -= count
        if self._left < 0:
            raise TooLongError(f"the answer is longer than {MAX_BODY_BYTES / 2**20:g} MiB")


class _Network(httpcore.SyncBackend):
    def __init__(self, budget: _Budget, http_first: bool) -> None:
        self._budget = budget
        self._http_first = http_first

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[httpcore.SOCKET_OPTION] | None = None,
    ) -> httpcore.NetworkStream:
        inner = super().connect_tcp(host, port, self._budget.seconds(), local_address, socket_options)
        return _Stream(inner, self._budget, self._http_first)


class _Stream(httpcore.NetworkStream):
    def __init__(self, inner: httpcore.NetworkStream, budget: _Budget, http_first: bool) -> None:
        self._inner = inner
        self._budget = budget
        self._http_first = http_first

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        data = self._inner.read(max_bytes, self._budget.seconds())
        self._budget.spend(len(data))
        if self._http_first and data:
            self._http_first = False
            if data.startswith(_TLS_ALERT):
                raise SpeaksTlsError("the server answers in TLS")
            if data[: len(_HTTP)] != _HTTP[: len(data)]:
                raise NotHttpError("the server does not speak HTTP")
        return data

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        for start in range(0, len(buffer), _PIECE_BYTES):
            self._inner.write(buffer[start : start + _PIECE_BYTES], self._budget.seconds())

    def close(self) -> None:
        self._inner.close()

    def start_tls(
        self, ssl_context: ssl.SSLContext, server_hostname: str | None = None, timeout: float | None = None
    ) -> httpcore.NetworkStream:
        encrypted = self._inner.start_tls(ssl_context, server_hostname, self._budget.seconds())
        return _Stream(encrypted, self._budget, http_first=True)

    def get_extra_info(self, info: str) -> object:
        return self._inner.get_extra_info(info)


@cache
def _certificates() -> ssl.SSLContext:
    return httpx.create_ssl_context()


def _pool(url: httpx.URL, budget: _Budget) -> httpcore.ConnectionPool:
    """One connection: direct, or through the proxy that the environment names."""
    proxy = _proxy(url)
    if proxy is None:
        return httpcore.ConnectionPool(ssl_context=_certificates(), network_backend=_Network(budget, http_first=True))
    socks = proxy.scheme.startswith("socks")
    if socks and find_spec("socksio") is None:
        raise httpx.ProxyError("a SOCKS proxy needs the package socksio: pip install socksio")
    kind: type[httpcore.SOCKSProxy | httpcore.HTTPProxy] = httpcore.SOCKSProxy if socks else httpcore.HTTPProxy
    return kind(
        str(proxy.copy_with(userinfo=b"")),
        proxy_auth=(proxy.username, proxy.password) if proxy.userinfo else None,
        ssl_context=_certificates(),
        network_backend=_Network(budget, http_first=not socks),
    )


def _proxy(url: httpx.URL) -> httpx.URL | None:
    # What is meant for this machine, a key in plain HTTP included, leaves it by no proxy.
    if is_this_machine(url.host) or proxy_bypass(url.host):
        return None
    named = getproxies()
    proxy = named.get(url.scheme) or named.get("all")
    return httpx.URL(proxy if "://" in proxy else f"http://{proxy}") if proxy else None
