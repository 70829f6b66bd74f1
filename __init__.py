"""battery-sim-agent: parameterise physics-based battery models by reasoning."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .core.errors import BsaError as BsaError
    from .core.record import Record as Record
    from .core.task import Task as Task
    from .experiments.api import CalibrationResult as CalibrationResult
    from .experiments.api import DiscoveryResult as DiscoveryResult
    from .experiments.api import calibrate as calibrate
    from .experiments.api import discover as discover
    from .experiments.api import read_record as read_record

__version__: str
"""Version of the installed distribution; pyproject.toml is its one source."""

_HOME = {
    "BsaError": ".core.errors",
    "CalibrationResult": ".experiments.api",
    "DiscoveryResult": ".experiments.api",
    "Record": ".core.record",
    "Task": ".core.task",
    "calibrate": ".experiments.api",
    "discover": ".experiments.api",
    "read_record": ".experiments.api",
}

__all__ = [
    "BsaError",
    "CalibrationResult",
    "DiscoveryResult",
    "Record",
    "Task",
    "calibrate",
    "discover",
    "read_record",
]


def __getattr__(name: str) -> Any:
    # Looked up when asked for: importing the package stays fast, and works in a tree that is not installed.
    if name == "__version__":
        from importlib.metadata import version

        return version("battery-sim-agent")
    if name in _HOME:
        from importlib import import_module

        return getattr(import_module(_HOME[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
