"""What each parameter does to each feature: the one form in which it is written into a prompt and read from it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from .numbers import finite_numbers

Unit = Literal["typical_step"]

_DIGITS = 3
"""Significant digits of an effect: slopes change more than that on the way to the next candidate."""


@dataclass(frozen=True)
class Sensitivities:
    """Change of each feature when one parameter rises by its unit of change.

    Attributes
    ----------
    effects : mapping of str to (mapping of str to float)
        By parameter, then by feature, in the feature's unit. What was not measured is absent.
    learnt_from : str
        Where the effects come from, in words.
    remarks : mapping
        What else is to be told of them, JSON-ready.
    unit : {'typical_step'}
        The change that the effects are told for: `Parameter.typical_step`, counted by `Parameter.in_steps`.
    """

    effects: Mapping[str, Mapping[str, float]]
    learnt_from: str = ""
    remarks: Mapping[str, Any] = field(default_factory=dict)
    unit: Unit = "typical_step"

    def content(self, budget: int) -> dict[str, Any]:
        """As it stands in a prompt, in ``budget`` characters where one effect of each parameter fits into them."""
        effects = {
            parameter: {feature: float(f"{effect:.{_DIGITS}g}") for feature, effect in rows.items()}
            for parameter, rows in self.effects.items()
            if rows
        }
        content = {
            "meaning": "change of each feature when one parameter rises by its typical_step; absent: not known",
            "unit": self.unit,
            "learnt_from": self.learnt_from,
            "effects": effects,
            **self.remarks,
        }
        while len(json.dumps(content)) > budget and any(len(rows) > 1 for rows in effects.values()):
            for rows in effects.values():
                if len(rows) > 1:
                    del rows[min(rows, key=lambda feature: abs(rows[feature]))]
        return content

    @classmethod
    def read(cls, content: object) -> Sensitivities:
        """From the content of a section; whatever is not of its form, or in another unit, is left out."""
        if not isinstance(content, Mapping) or content.get("unit") != "typical_step":
            return cls({})
        effects = content.get("effects")
        read = {name: finite_numbers(rows) for name, rows in effects.items()} if isinstance(effects, Mapping) else {}
        return cls({name: rows for name, rows in read.items() if rows}, str(content.get("learnt_from", "")))
