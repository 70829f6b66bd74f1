"""Why a server cannot be reached, and what to do about it: one message for each cause."""

import errno
import socket
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

import httpx

from ..core.redaction import redact
from .addresses import shown
from .bounded_http import InTheClearError, NotHttpError, RedirectedError, SpeaksTlsError
from .retrying import TransientError, UnreachableError

_NO_ROUTE = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EADDRNOTAVAIL)


@dataclass(frozen=True)
class _Rule:
    """What an error means; ``{place}``, ``{address}``, ``{host}`` and ``{error}`` are filled in."""

    applies: Callable[[BaseException], bool]
    reason: str
    hint: str
    may_pass: bool = False


def _is(*kinds: type[BaseException]) -> Callable[[BaseException], bool]:
    return lambda error: isinstance(error, kinds)


_RULES = (
    _Rule(
        _is(RedirectedError),
        "{address} {error}, which is not followed: a key and a prompt are for one address",
        "name the address that it leads to, if you trust it",
    ),
    _Rule(_is(InTheClearError), "{error}", "write https://"),
    _Rule(_is(SpeaksTlsError), "{place} takes encrypted connections only", "write https://{place}"),
    _Rule(
        _is(ssl.SSLCertVerificationError),
        "the certificate of {place} is not trusted ({error})",
        "correct the host's name, or name the certificate's authority in the variable SSL_CERT_FILE",
    ),
    # A connection cut in the handshake tells nothing of what listens there.
    _Rule(_is(ssl.SSLEOFError), "{place} ended the encrypted connection at once", "correct the port", True),
    _Rule(_is(ssl.SSLError), "{place} does not answer in TLS ({error})", "write http://{place} if it takes plain HTTP"),
    _Rule(_is(socket.gaierror), "the host {host} is not known", "correct the name, or check the network", True),
    _Rule(
        _is(ConnectionRefusedError),
        "nothing listens at {place} (connection refused)",
        "start the server, or correct the port",
        True,
    ),
    _Rule(
        lambda error: isinstance(error, OSError) and error.errno in _NO_ROUTE,
        "there is no way to {place} ({error})",
        "correct the address, or check the network",
        True,
    ),
    _Rule(
        _is(httpx.ConnectTimeout),
        "{place} does not take the connection within the time-out",
        "correct the address, or check the firewall",
        True,
    ),
    _Rule(_is(httpx.ProxyError), "the proxy does not lead to {place} ({error})", "correct HTTPS_PROXY or NO_PROXY"),
    _Rule(_is(NotHttpError), "what listens at {place} does not speak HTTP", "correct the port"),
)


def connection_failure(error: BaseException) -> TransientError | TimeoutError | None:
    """What went wrong between here and a server, by what a client library raised; None if it answered.

    `UnreachableError` if there was no connection, `TimeoutError` if the answer did not end in time, another
    `TransientError` if it was cut or too long.
    """
    causes = _causes(error)
    broken = next((cause for cause in causes if isinstance(cause, httpx.RequestError)), None)
    if broken is None:
        return None
    parts = urlsplit(shown(str(broken.request.url)))
    for cause in causes:
        for rule in _RULES:
            if rule.applies(cause):
                words = {"address": parts.geturl(), "place": parts.netloc, "host": parts.hostname}
                reason = rule.reason.format(**words, error=redact(str(cause)))
                refused = isinstance(cause, ConnectionRefusedError)
                return UnreachableError(reason, rule.hint.format(**words), rule.may_pass, refused)
    if isinstance(broken, httpx.TimeoutException):
        return TimeoutError(str(broken))
    return TransientError(f"{parts.netloc}: {redact(str(broken))}")


def _causes(error: BaseException) -> list[BaseException]:
    """The error and what led to it, the deepest first, since wrappers say less."""
    found: list[BaseException] = []
    at: BaseException | None = error
    while at is not None and at not in found:
        found.append(at)
        at = at.__cause__ or at.__context__
    return found[::-1]


def in_short(error: Exception) -> str:
    """What a client library says went wrong: on one line, without keys, and not all of a page that a server sent."""
    return redact(f"{type(error).__name__}: {' '.join(str(error).split())}")[:300]
