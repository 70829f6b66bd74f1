"""battery-sim-agent: parameterise physics-based battery models by reasoning."""

from __future__ import annotations

__version__: str
"""Version of the installed distribution; pyproject.toml is its one source."""


def __getattr__(name: str) -> str:
    # Looked up when asked for: importing the package stays fast, and works in a tree that is not installed.
    if name == "__version__":
        from importlib.metadata import version

        return version("battery-sim-agent")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
