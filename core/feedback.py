"""The package F_t of the paper: what a proposer is told about a trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .numbers import finite_number, finite_numbers
from .prompt_sections import read_table, table

_COLUMNS = ("feature", "mismatch", "tolerance")


@dataclass(frozen=True)
class Feedback:
    """What one trial showed.

    Attributes
    ----------
    content : mapping
        JSON-ready: ``residuals``, ``features`` and their ``tolerances`` by name, events, tables; compact and rounded.
    images : tuple of Path
        Overlay images for models that see.
    """

    content: Mapping[str, Any] = field(default_factory=dict)
    images: tuple[Path, ...] = ()

    @property
    def numbers(self) -> dict[str, float]:
        """What is to become zero, by name: the features, or the residuals where there are no features."""
        return finite_numbers(self.content.get("features")) or finite_numbers(self.content.get("residuals"))

    @property
    def tolerances(self) -> dict[str, float]:
        """The size of a mismatch that counts as one, by feature."""
        return {name: size for name, size in finite_numbers(self.content.get("tolerances")).items() if size > 0}

    def told(self) -> dict[str, Any]:
        """As it stands in a prompt: features and tolerances side by side, each name once."""
        features, tolerances = finite_numbers(self.content.get("features")), self.tolerances
        content = {key: value for key, value in self.content.items() if key not in ("features", "tolerances")}
        if features:
            content["features"] = table(
                _COLUMNS, ([name, value, tolerances.get(name)] for name, value in features.items())
            )
        return content

    @classmethod
    def read(cls, content: object) -> Feedback:
        """The inverse of `told`; whatever is not of its form is left out."""
        if not isinstance(content, Mapping):
            return cls()
        _, rows = read_table(content.get("features"))
        rows = [row for row in rows if len(row) == len(_COLUMNS)]
        features = {str(name): value for name, value, _ in rows if finite_number(value) is not None}
        tolerances = {str(name): size for name, _, size in rows if finite_number(size) is not None}
        return cls({**content, "features": features, "tolerances": tolerances})
