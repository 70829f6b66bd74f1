"""The scripts that a run exports, as PyBaMM objects: what a notebook gets is what the file says."""

from typing import Any


def namespace_of(script: str, name: str) -> dict[str, Any]:
    """What an exported script defines; ``name`` is what tracebacks call it.

    The script is made by this package in this process: a file in a run's folder may be anyone's and is never run.
    """
    namespace: dict[str, Any] = {"__name__": name}
    exec(compile(script, f"<{name}>", "exec"), namespace)
    return namespace
