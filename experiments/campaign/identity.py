"""What makes two cells the same: everything that determines a result, and nothing that does not."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any

from ...core.registry import installed
from ...core.run_config import RunConfig
from ..run import versions

PLACEMENT = frozenset({"base_url", "timeout_s", "retry_limit_s", "exchange"})
"""Options of a backend that say where and how patiently it is asked, not what it answers."""

_ROOT = Path(__file__).parents[2]
_DECISIVE = ("core", "plugins", "backends")


def without_placement(options: dict[str, Any]) -> dict[str, Any]:
    """The options of a backend that determine its answers: a server that moved is still the same model."""
    return {key: value for key, value in options.items() if key not in PLACEMENT}


def identity_of(config: RunConfig, task_digest: str) -> str:
    """A cell's identity, 16 hex digits.

    The configuration is without placement; the hash of the encoded task stands for the task, which may be 100 kB long.
    """
    return config.identity({"digest": task_digest}, dict(versions_of(_plugins(config))))


@cache
def versions_of(plugins: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """What is installed, the code itself included, and who offers the plugins that take part."""
    registry = installed()
    origins: dict[tuple[str, str], str] = {
        (listing.kind, listing.entry.name): listing.origin for listing in registry.listings()
    }
    found = {**versions(), "code": code_digest()}
    for kind, name in plugins:
        origin = origins.get((kind, name))
        if origin is not None and not origin.startswith("battery-sim-agent "):
            found[f"{kind} {name}"] = origin
    return tuple(sorted(found.items()))


@cache
def code_digest() -> str:
    """A hash of the sources that decide what a run finds: a version number alone does not change with every edit."""
    digest = hashlib.sha256()
    for room in _DECISIVE:
        for path in sorted((_ROOT / room).rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _plugins(config: RunConfig) -> tuple[tuple[str, str], ...]:
    backend = config.backend.partition(":")[0]
    route = str(config.backend_options.get("via") or backend)
    chosen = ((kind, choice.use) for kind, choice in config.scaffold.parts)
    return (*chosen, ("backend", backend), ("route", route))
