"""The coordinates of a fit: each parameter in units of how far it may plausibly be off."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..effect import Effect
from ..parameters import Parameter
from ..trajectory import FloatArray


@dataclass(frozen=True)
class Axis:
    """One fitted parameter.

    The coordinate is ``u = (x - x0) / spread`` with ``x`` the value, or its logarithm on a log scale.

    Attributes
    ----------
    parameter : Parameter
        Name, bounds, scale and the value ``x0`` that was believed before.
    spread : float
        What counts as a unit, on the parameter's own scale.
    prior : bool
        Whether the spread is a belief: one standard deviation of a normal prior. Effects have none.
    step : float
        Finite-difference step in units of ``u``.
    """

    parameter: Parameter
    spread: float
    prior: bool
    step: float = 0.1

    @property
    def name(self) -> str:
        """The parameter's name in a candidate."""
        return self.parameter.name

    def coordinate(self, value: float) -> float:
        """The coordinate of a value."""
        if self.parameter.scale == "log":
            return math.log(value / self.parameter.initial) / self.spread
        return (value - self.parameter.initial) / self.spread

    def value(self, u: float) -> float:
        """The value at a coordinate, kept inside the bounds."""
        if self.parameter.scale == "log":
            return self.parameter.project(self.parameter.initial * math.exp(u * self.spread))
        return self.parameter.project(self.parameter.initial + u * self.spread)

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds as coordinates."""
        return self.coordinate(self.parameter.lower), self.coordinate(self.parameter.upper)


def effect_axes(effects: Sequence[Effect]) -> tuple[Axis, ...]:
    """Axes of the effects' own parameters, starting at their probes; null values are not believed in."""
    axes: list[Axis] = []
    for effect in effects:
        for p, parameter in zip(effect.parameters, effect.searched, strict=True):
            spread = math.log(2.0) if p.scale == "log" else abs(p.probe - p.null) or 0.1 * (p.upper - p.lower)
            axes.append(Axis(parameter, spread, prior=p.scale == "log", step=0.25))
    return tuple(axes)


def candidate_of(axes: Sequence[Axis], u: FloatArray) -> dict[str, float]:
    """The candidate at coordinates of shape (p,)."""
    return {axis.name: axis.value(float(value)) for axis, value in zip(axes, u, strict=True)}


def coordinates_of(axes: Sequence[Axis], candidate: dict[str, float]) -> FloatArray:
    """The inverse of `candidate_of`; parameters that the candidate lacks start where they were believed."""
    return np.array([axis.coordinate(candidate.get(axis.name, axis.parameter.initial)) for axis in axes])
