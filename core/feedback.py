"""The package F_t of the paper: what a proposer is told about a trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .numbers import finite_numbers


@dataclass(frozen=True)
class Feedback:
    """What one trial showed.

    Attributes
    ----------
    content : mapping
        JSON-ready: residuals, features, events; compact and rounded, as it goes into a prompt.
    images : tuple of Path
        Overlay images for models that see.
    """

    content: Mapping[str, Any] = field(default_factory=dict)
    images: tuple[Path, ...] = ()

    @property
    def numbers(self) -> dict[str, float]:
        """What is to become zero, by name: the features, or the residuals where there are no features."""
        return finite_numbers(self.content.get("features")) or finite_numbers(self.content.get("residuals"))
