"""Models by short name, and their names under each route: the file ``presets.yaml`` and the user's own."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.errors import BsaError
from ..core.yaml_text import read_yaml

_SHIPPED = Path(__file__).with_name("presets.yaml")


@dataclass(frozen=True)
class Preset:
    """A model under a short name."""

    name: str  # The short name.
    # The model's names under each route, routes in the order in which they are tried. Whether there are such routes is
    # found out when the preset is used: plugins may add some.
    models: Mapping[str, tuple[str, ...]]
    file: str = ""  # Where the preset is written, for messages.

    @property
    def summary(self) -> str:
        """One line for a listing."""
        return f"{next(iter(self.models.values()))[0]}, by {', '.join(self.models)}."


def load_presets() -> dict[str, Preset]:
    """The presets of the package, and over them the user's.

    Raises `BsaError` if the user's file cannot be read or holds something else than presets.
    """
    presets = _parse(read_yaml(_SHIPPED), _SHIPPED.name)
    named = os.environ.get("BSA_PRESETS")
    path = Path(named) if named else Path("bsa-presets.yaml")
    if named or path.is_file():
        presets |= _parse(read_yaml(path), str(path))
    return presets


def _parse(content: Any, where: str) -> dict[str, Preset]:
    content = content or {}
    if not isinstance(content, dict):
        raise BsaError(f"{where} holds no presets.", "write `my-model:` and below it `  ollama: my-model:8b`.")
    return {str(name): Preset(str(name), _models(str(name), routes, where), where) for name, routes in content.items()}


def _models(preset: str, routes: Any, where: str) -> dict[str, tuple[str, ...]]:
    if not isinstance(routes, dict) or not routes:
        raise BsaError(f'{where}: preset "{preset}" names no route.', "write `  ollama: my-model:8b` below it.")
    models: dict[str, tuple[str, ...]] = {}
    for route, names in routes.items():
        listed = names if isinstance(names, list) else [names]
        if not listed or not all(isinstance(name, str) and name for name in listed):
            raise BsaError(f'{where}: preset "{preset}", route "{route}" names {names!r}.', "write the model's name.")
        models[str(route)] = tuple(listed)
    return models
