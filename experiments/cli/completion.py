"""What the shell offers after an option. Everything here answers without importing a simulator."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from importlib.resources import files
from typing import get_args

import yaml

from ...core.contracts.kinds import KINDS, Kind


def _installed(kind: Kind) -> Callable[[], list[str]]:
    def names() -> list[str]:
        from ...core.contracts.registry import installed

        return sorted(installed().names(kind))

    return names


# What plugins offer; the presets of models are among the backends.
backends, routes = _installed("backend"), _installed("route")
readers, effects = _installed("reader"), _installed("effect")


def tasks() -> list[str]:
    """Names of the tasks that need no file."""
    from ..tasks.find import task_summaries

    return list(task_summaries())


def scaffolds() -> list[str]:
    """Names of the scaffolds that come with the package."""
    from ...core.scaffold import built_in_names

    return built_in_names()


def grids() -> list[str]:
    """Names of the grids that come with the package."""
    from ..campaign.grid_file import shipped_names

    return shipped_names()


def kinds() -> list[str]:
    """Kinds of plugins."""
    return list(KINDS)


def current_signs() -> list[str]:
    """Sign conventions of a current."""
    from ...core.record import CurrentSign

    return list(get_args(CurrentSign))


def parameter_sets() -> list[str]:
    """Names of the parameter sets, as PyBaMM finds them itself.

    Those of half-cells, blends and other cells, which are not simulated, are among them: only a set that is loaded
    tells what it is of.
    """
    return sorted(point.name for point in entry_points(group="pybamm_parameter_sets"))


def search_presets() -> list[str]:
    """Names of the search spaces."""
    from ...plugins.pybamm import before_search

    return list(yaml.safe_load((files(before_search) / "search_presets.yaml").read_text(encoding="utf-8")))


def uncertain_presets() -> list[str]:
    """Names of what a discovery may take as uncertain."""
    from ...plugins.pybamm.before_search.uncertain_parameters import PRESETS

    return list(PRESETS)
