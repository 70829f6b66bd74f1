"""Models by short name, and their names under each route: the file ``presets.yaml`` and the user's own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

from ..core.errors import BsaError, did_you_mean
from .options import ROUTES, Route

USER_FILE_VARIABLE = "BSA_PRESETS"
USER_FILE = "bsa-presets.yaml"


@dataclass(frozen=True)
class Preset:
    """A model under a short name.

    Attributes
    ----------
    name : str
        The short name.
    models : mapping of route to tuple of str
        The model's names under each route, routes in the order in which they are tried.
    """

    name: str
    models: Mapping[Route, tuple[str, ...]]

    @property
    def summary(self) -> str:
        """One line for a listing."""
        return f"{next(iter(self.models.values()))[0]}, by {', '.join(self.models)}."


def load_presets() -> dict[str, Preset]:
    """The presets of the package, and over them the user's.

    Raises
    ------
    BsaError
        If the user's file cannot be read or holds an unknown route.
    """
    presets = _parse(files(__package__).joinpath("presets.yaml").read_text("utf-8"), "presets.yaml")
    named = os.environ.get(USER_FILE_VARIABLE)
    path = Path(named) if named else Path(USER_FILE)
    if named or path.is_file():
        try:
            presets |= _parse(path.read_text("utf-8"), str(path))
        except (OSError, UnicodeDecodeError) as error:
            raise BsaError(f"{path} cannot be read: {error}.", f"mend it, or unset {USER_FILE_VARIABLE}.") from None
    return presets


def _parse(text: str, where: str) -> dict[str, Preset]:
    try:
        content = yaml.safe_load(text) or {}
    except yaml.YAMLError as error:
        raise BsaError(
            f"{where} is not YAML: {' '.join(str(error).split())}.", "mend the line that it names."
        ) from None
    if not isinstance(content, dict):
        raise BsaError(f"{where} holds no presets.", "write `my-model:` and below it `  ollama: my-model:8b`.")
    return {str(name): Preset(str(name), _models(str(name), routes, where)) for name, routes in content.items()}


def _models(preset: str, routes: Any, where: str) -> dict[Route, tuple[str, ...]]:
    if not isinstance(routes, dict) or not routes:
        raise BsaError(f'{where}: preset "{preset}" names no route.', f"routes: {', '.join(ROUTES)}.")
    models: dict[Route, tuple[str, ...]] = {}
    for written, names in routes.items():
        route = next((known for known in ROUTES if known == written), None)
        if route is None:
            hint = did_you_mean(str(written), ROUTES) or f"routes: {', '.join(ROUTES)}."
            raise BsaError(f'{where}: preset "{preset}" has no route "{written}".', hint)
        listed = names if isinstance(names, list) else [names]
        if not listed or not all(isinstance(name, str) and name for name in listed):
            raise BsaError(f'{where}: preset "{preset}", route "{route}" names {names!r}.', "write the model's name.")
        models[route] = tuple(listed)
    return models
