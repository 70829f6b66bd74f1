"""What the shell offers after an option. Everything here answers without importing a simulator."""

from __future__ import annotations

from importlib.metadata import entry_points
from importlib.resources import files
from typing import TYPE_CHECKING, get_args

import yaml

if TYPE_CHECKING:
    from ...core.registry import Kind


def tasks() -> list[str]:
    """Names of the tasks that need no file."""
    from ..tasks.find import packaged_tasks

    return [*(name for name, _ in packaged_tasks()), *_installed("task")]


def scaffolds() -> list[str]:
    """Names of the scaffolds that come with the package."""
    from ...core.scaffold import built_in_names

    return built_in_names()


def grids() -> list[str]:
    """Names of the grids that come with the package."""
    from ..campaign.grid_file import shipped_names

    return shipped_names()


def backends() -> list[str]:
    """Names of the backends and of the model presets."""
    return _installed("backend")


def routes() -> list[str]:
    """Names of the routes to language models."""
    return _installed("route")


def kinds() -> list[str]:
    """Kinds of plugins."""
    from ...core.registry import KINDS

    return list(KINDS)


def readers() -> list[str]:
    """Names of the readers."""
    return _installed("reader")


def effects() -> list[str]:
    """Names of the effects."""
    return _installed("effect")


def current_signs() -> list[str]:
    """Sign conventions of a current."""
    from ...core.record import CurrentSign

    return list(get_args(CurrentSign))


def parameter_sets() -> list[str]:
    """Names of the parameter sets, as PyBaMM finds them itself."""
    return sorted(point.name for point in entry_points(group="pybamm_parameter_sets"))


def search_presets() -> list[str]:
    """Names of the search spaces."""
    from ...plugins import pybamm

    return list(yaml.safe_load((files(pybamm) / "search_presets.yaml").read_text(encoding="utf-8")))


def uncertain_presets() -> list[str]:
    """Names of what a discovery may take as uncertain."""
    from ...plugins.pybamm.uncertain_parameters import PRESETS

    return list(PRESETS)


def _installed(kind: Kind) -> list[str]:
    from ...core.registry import installed

    return sorted(installed().names(kind))
