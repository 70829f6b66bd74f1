"""What each parameter does to each feature: the one form in which it is written into a prompt and read from it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .bounded_step import bounded_step
from .numbers import finite_number
from .prompt_sections import named, read_table, table
from .trajectory import FloatArray

_UNIT = "typical_step"
"""The change that effects are told for: `Parameter.typical_step`, counted by `Parameter.in_steps`."""

_DIGITS = 3
"""Significant digits of an effect: slopes change more than that on the way to the next candidate."""

_WHOLE = 10.0
"""Effects of this size and more are rounded to whole numbers: a linear model is off by five percent or more."""

_RESOLVED = 1e-4
"""Share of the largest effect on a feature below which another one's digits are left out."""

_ALL = 400
"""Decimals that leave every number as it is."""

_DAMPING = 0.02
"""Share of the mismatch, in tolerances, that a change by one typical step must remove to be worth it."""

_FIRST, _LAST = "parameter", "effects"
"""The ends of a row; what differs between parameters stands between them."""

_MEANING = "change when a parameter rises by its step; null or absent: not measured"
_ABOUT = "; points: simulations that moved it; misprediction_pct: their part that is unexplained"

AS_SHOWN = "the feedback's list, in its order"
"""Stands in for the names of features that the feedback lists already."""


@dataclass(frozen=True)
class Sensitivities:
    """Change of each feature when one parameter rises by its unit of change."""

    # By parameter, then by feature, in the feature's unit. What was not measured is absent.
    effects: Mapping[str, Mapping[str, float]]
    learnt_from: str = ""  # Where the effects come from, in words.
    remarks: Mapping[str, Any] = field(default_factory=dict)  # What else is to be told of them, JSON-ready.
    points: Mapping[str, int] = field(default_factory=dict)  # How many simulations moved each parameter.
    # What the effects leave unexplained of those simulations, in percent: 0 where a parameter acts linearly.
    misprediction_pct: Mapping[str, float] = field(default_factory=dict)

    def content(self, budget: int, shown: Sequence[str] = ()) -> dict[str, Any]:
        """As it stands in a prompt, in ``budget`` characters where one effect fits into them.

        Parameters
        ----------
        budget : int
            Characters of JSON. What does not fit is left out, the weakest first: features, then parameters.
        shown : sequence of str
            The features that the prompt's feedback shows, whose names need not stand here again.
        """
        features = list(dict.fromkeys(feature for rows in self.effects.values() for feature in rows))
        if set(shown) == set(features):
            features = list(shown)
        told, largest = self, self._largest(features)
        content = told._content(features, shown)
        while len(json.dumps(content)) > budget and (len(features) > 1 or len(told.effects) > 1):
            if len(features) > 1:
                features.remove(min(features, key=lambda name: largest[name]))
            else:
                told = told._without_weakest(features[0])
            content = told._content(features, shown)
        return content

    def _without_weakest(self, feature: str) -> Sensitivities:
        """Without the parameter that moves a feature least."""
        weakest = min(self.effects, key=lambda name: abs(self.effects[name].get(feature, 0.0)))
        return replace(self, effects={name: rows for name, rows in self.effects.items() if name != weakest})

    def _content(self, features: Sequence[str], shown: Sequence[str]) -> dict[str, Any]:
        finest = {name: _decimals(_RESOLVED * size) for name, size in self._largest(features).items()}
        told = {name: row for name, row in self.effects.items() if any(feature in row for feature in features)}
        about: dict[str, list[Any]] = {
            "points": [self.points.get(name) for name in told],
            "misprediction_pct": [_rounded(self.misprediction_pct.get(name), 2) for name in told],
        }
        alike = {key: values[0] for key, values in about.items() if len(set(values)) == 1}
        differing = {key: values for key, values in about.items() if key not in alike}
        effects = [
            [_rounded(row.get(feature), _DIGITS, finest[feature]) for feature in features] for row in told.values()
        ]
        rows = [
            [name, *(values[place] for values in differing.values()), effects[place]] for place, name in enumerate(told)
        ]
        return {
            "meaning": _MEANING + (_ABOUT if self.points else ""),
            "unit": _UNIT,
            "learnt_from": self.learnt_from,
            "effects_on": AS_SHOWN if features and features == list(shown) else features,
            **{key: value for key, value in alike.items() if value is not None},
            "effects": table([_FIRST, *differing, _LAST], rows),
            **self.remarks,
        }

    def _largest(self, features: Sequence[str]) -> dict[str, float]:
        """The size of the strongest effect on each feature."""
        rows = self.effects.values()
        return {name: max((abs(row.get(name, 0.0)) for row in rows), default=0.0) for name in features}

    @classmethod
    def read(cls, content: object, shown: Sequence[str] = (), parameters: Sequence[str] = ()) -> Sensitivities:
        """From the content of a section; whatever is not of its form, or in another unit, is left out.

        Parameters
        ----------
        shown : sequence of str
            The features that the prompt's feedback shows.
        parameters : sequence of str
            The parameters in the order of the prompt's table, by whose numbers rows may go.
        """
        if not isinstance(content, Mapping) or content.get("unit") != _UNIT:
            return cls({})
        columns, rows = read_table(content.get("effects"))
        names = shown if content.get("effects_on") == AS_SHOWN else content.get("effects_on")
        if (*columns[:1], *columns[-1:]) != (_FIRST, _LAST):
            return cls({})
        if not isinstance(names, Sequence) or isinstance(names, str):
            return cls({})
        effects = {named(row[0], parameters): _numbers(names, row[-1]) for row in rows}
        return cls({name: row for name, row in effects.items() if row}, str(content.get("learnt_from", "")))

    def slopes(self, parameters: Sequence[str], features: Sequence[str]) -> FloatArray:
        """The effects as a matrix of shape (f, p); 0 where nothing is known."""
        rows = [[self.effects.get(name, {}).get(feature, 0.0) for name in parameters] for feature in features]
        return np.array(rows).reshape(len(features), len(parameters))

    def predicted(self, now: Mapping[str, float], steps: Mapping[str, float]) -> dict[str, float]:
        """The features after a change, each parameter by so many typical steps, if all acts linearly."""
        return {
            feature: value + sum(self.effects.get(name, {}).get(feature, 0.0) * rise for name, rise in steps.items())
            for feature, value in now.items()
        }


def linear_change(
    slopes: FloatArray, mismatch: FloatArray, tolerance: FloatArray, lower: FloatArray, upper: FloatArray, radius: float
) -> FloatArray:
    """The change that removes most of the mismatch if all acts linearly, in typical steps, shape (p,).

    Levenberg's damping in proportion to the mismatch (Fan & Yuan, Computing 74 (2005) 23). Far from the record the
    error of the linear model is larger than the effect of weak parameters, which are hardly moved; near the record the
    damping vanishes.

    Parameters
    ----------
    slopes : ndarray of shape (f, p)
        Change of each feature per typical step.
    mismatch, tolerance : ndarray of shape (f,)
        The features now, and what counts as one of each.
    lower, upper : ndarray of shape (p,)
        Room to both sides, in typical steps.
    radius : float
        Length of the longest change, in typical steps.
    """
    residual, count = mismatch / tolerance, slopes.shape[1]
    damping = _DAMPING * float(np.linalg.norm(residual)) * np.eye(count)
    stacked, target = np.vstack([slopes / tolerance[:, None], damping]), np.append(residual, np.zeros(count))
    return bounded_step(stacked, target, np.minimum(lower, 0.0), np.maximum(upper, 0.0), radius)


def _rounded(value: float | None, digits: int, decimals: int = _ALL) -> float | None:
    """To so many digits and decimals, whole from ten on."""
    if value is None:
        return None
    found = round(float(f"{value:.{digits}g}"), decimals)
    return found if abs(found) < _WHOLE else float(round(found))


def _decimals(size: float) -> int:
    """Decimals that resolve a number of this size."""
    return _ALL if size <= 0 else math.ceil(-math.log10(size))


def _numbers(names: Sequence[Any], values: object) -> dict[str, float]:
    if not isinstance(values, list) or len(values) != len(names):
        return {}
    pairs = zip(map(str, names), map(finite_number, values), strict=True)
    return {name: value for name, value in pairs if value is not None}
