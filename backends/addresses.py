"""Addresses of servers: where they are looked for, how they are shown, and who could read what is sent there."""

import ipaddress
import os
from urllib.parse import SplitResult, urlsplit

from ..core.errors import BsaError

_OLLAMA_PORT = 11434
_PORTS = {"http": 80, "https": 443}


def is_this_machine(host: str) -> bool:
    """Whether a host is this machine."""
    try:
        address = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return host.casefold() == "localhost"
    return address.is_loopback or address.is_unspecified


def is_private(address: str) -> bool:
    """Whether nobody on the way can read what is sent: it is encrypted, or stays on this machine."""
    parts = urlsplit(address)
    return parts.scheme == "https" or is_this_machine(parts.hostname or "")


def origin(address: str) -> tuple[str, str, int | None]:
    """Scheme, host and port: what makes two addresses one server."""
    parts = urlsplit(address)
    return parts.scheme, parts.hostname or "", parts.port or _PORTS.get(parts.scheme)


def shown(address: str) -> str:
    """The address as messages show it: without user name and password."""
    parts = urlsplit(address)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()


def openai_address(by_option: str | None = None) -> str | None:
    """Where an OpenAI-compatible server is looked for: as named, else by ``OPENAI_BASE_URL``; None if by neither.

    Raises `BsaError` if the variable holds no address.
    """
    named = by_option or os.environ.get("OPENAI_BASE_URL", "").strip()
    if not named:
        return None
    _check(named, "OPENAI_BASE_URL")
    return named.rstrip("/")


def ollama_address(by_option: str | None = None) -> str:
    """Where an Ollama server is looked for: as named, else by ``OLLAMA_HOST``, else on this machine.

    The variable is read as Ollama's own client reads it: ``host``, ``host:port`` or a full address. A server that
    listens on all interfaces is asked on this one.

    Raises `BsaError` if the variable holds no address.
    """
    named = (by_option or os.environ.get("OLLAMA_HOST", "")).strip().rstrip("/") or "127.0.0.1"
    if "://" not in named:
        parts = _check(f"http://{named}" if not named.startswith(":") else f"http://127.0.0.1{named}", "OLLAMA_HOST")
        port = "" if parts.port else f":{_OLLAMA_PORT}"
        named = f"http://{parts.netloc}{port}{parts.path}"
    _check(named, "OLLAMA_HOST")
    return named.replace("://0.0.0.0", "://127.0.0.1", 1)


def _check(address: str, variable: str) -> SplitResult:
    try:
        parts = urlsplit(address)
        if parts.scheme in ("http", "https") and parts.hostname and (parts.port is None or parts.port > 0):
            return parts
    except ValueError:
        pass
    # Without the value: what is no address may hold a password anywhere.
    raise BsaError(f"the variable {variable} holds no address.", f"export {variable}=http://HOST:PORT")
