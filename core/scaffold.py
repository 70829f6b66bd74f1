"""A scaffold: a named composition of plugins, written as a short YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field, model_validator

from .errors import unknown
from .validation import validated
from .yaml_text import YAML_SUFFIXES, read_yaml

BUILT_IN = Path(__file__).parent.parent / "scaffolds"

Part = Literal["simulator", "feedback", "memory", "proposer", "warm-up"]
"""Kinds of plugins of which a scaffold is made."""


class PluginChoice(BaseModel, extra="forbid"):
    """A plugin and its options; in a file either its name alone or ``{use: name, options: {...}}``."""

    use: str = Field(description="Name of the plugin, as bsa list shows it.")
    options: dict[str, Any] = Field(default_factory=dict, description="The plugin's own options.")

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, value: Any) -> Any:
        return {"use": value} if isinstance(value, str) else value


class Scaffold(BaseModel, extra="forbid"):
    """Which plugins take part in a run."""

    name: str = Field(description="Name of the scaffold.")
    summary: str = Field("", description="One line for bsa list.")
    simulator: PluginChoice = Field(PluginChoice(use="pybamm"), description="What simulates candidates.")
    feedback: PluginChoice = Field(PluginChoice(use="structured"), description="What turns outcomes into feedback.")
    memories: list[PluginChoice] = Field(
        default_factory=list, description="What is remembered and recalled, priors included; none means no memory."
    )
    warm_up: PluginChoice | None = Field(None, description="What is tried before the search; none means nothing.")
    proposer: PluginChoice = Field(description="What says which candidate to try next.")
    offers: list[str] = Field(
        default_factory=list,
        exclude_if=lambda offers: not offers,
        description="Effects of the catalogue that the proposer may add to the model of a cell under its current.",
    )

    @property
    def parts(self) -> list[tuple[Part, PluginChoice]]:
        """Every plugin that takes part, behind its kind."""
        parts: list[tuple[Part, PluginChoice]] = [("simulator", self.simulator), ("feedback", self.feedback)]
        parts += [("memory", memory) for memory in self.memories]
        parts.append(("proposer", self.proposer))
        return parts if self.warm_up is None else [*parts, ("warm-up", self.warm_up)]

    def made_for(self, simulator: str) -> Scaffold:
        """The scaffold on a task's simulator; as it is where it names one itself, or the task names none."""
        if not simulator or "simulator" in self.model_fields_set:
            return self
        return self.model_copy(update={"simulator": PluginChoice(use=simulator)})


def load_scaffold(name_or_path: str) -> Scaffold:
    """A built-in scaffold by name, or one from a YAML file.

    Raises `BsaError` if there is no such scaffold, or the file is not a valid one.
    """
    path = Path(name_or_path)
    if path.suffix not in YAML_SUFFIXES:
        path = BUILT_IN / f"{name_or_path}.yaml"
        names = built_in_names()
        if name_or_path not in names:
            listed = "built in: {}; or give the path of a .yaml file of your own."
            raise unknown(f'there is no scaffold "{name_or_path}".', name_or_path, names, listed)
    return validated(Scaffold, read_yaml(path), str(path))


def built_in_names() -> list[str]:
    """The scaffolds that come with the package."""
    return sorted(path.stem for path in BUILT_IN.glob("*.yaml"))
