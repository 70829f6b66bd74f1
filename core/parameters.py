"""What may be varied: parameters with bounds and scale, and the space they span."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .errors import BsaError, did_you_mean
from .target import CellChange, Factor, Target, Value, change_of
from .trajectory import FloatArray

Scale = Literal["linear", "log"]
Candidate = Mapping[str, float]
"""A value for every searched parameter, by its PyBaMM name."""

_UNIT = re.compile(r"\[([^\[\]]*)\]")

_AT_BOUND = 1e-3
"""Share of the range between the bounds within which a value is at a bound: fits end that near to one, not on it."""


@dataclass(frozen=True)
class Parameter:
    """A quantity that the search may vary.

    Attributes
    ----------
    name : str
        What people and models call it: PyBaMM's own name, unit included, where it replaces a number of the
        parameter set; see `target_named` for the names of other targets.
    initial : float
        Where the search starts.
    lower, upper : float
        Physical bounds, ``lower < upper``.
    scale : {'linear', 'log'}
        The axis on which steps of equal length mean equally much.
    target : Target or None
        What it acts on; None is the number of the parameter set that has its name.
    deviation : float or None
        How far the value may plausibly be off, on the parameter's own scale: the unit of `coordinate`. None is the
        whole range between the bounds.
    prior : bool
        Whether the deviation is the standard deviation of a normal prior around `origin`.
    difference : float
        Finite-difference step in units of the deviation.
    expected : float or None
        The mean of the prior, where the search starts elsewhere.
    """

    name: str
    initial: float
    lower: float
    upper: float
    scale: Scale = "linear"
    target: Target | None = None
    deviation: float | None = None
    prior: bool = False
    difference: float = 0.1
    expected: float | None = None

    def __post_init__(self) -> None:
        values = (self.initial, self.lower, self.upper)
        if not all(math.isfinite(value) for value in values):
            raise BsaError(f'"{self.name}": bounds and initial value must be finite, got {values}.')
        if not self.lower < self.upper:
            raise BsaError(
                f'"{self.name}": lower < upper must hold, but got (lower={self.lower:g}, upper={self.upper:g}).'
            )
        if not self.lower <= self.initial <= self.upper:
            raise BsaError(
                f'"{self.name}": the initial value {self.initial:g} lies outside [{self.lower:g}, {self.upper:g}].',
                "widen the bounds or move the initial value.",
            )
        if self.scale == "log" and self.lower <= 0:
            raise BsaError(
                f'"{self.name}": a log scale needs lower > 0, but got {self.lower:g}.', 'use scale "linear".'
            )

    @property
    def unit(self) -> str:
        """The unit in PyBaMM's notation; empty for a pure number."""
        if isinstance(self.target, Factor):
            return ""
        found = _UNIT.search(self.name)
        return found.group(1) if found else ""

    @property
    def typical_step(self) -> str:
        """A change worth trying, in the notation of a proposal: ``"*1.1"``, or ``"+0.03"`` on a linear scale."""
        return "*1.1" if self.scale == "log" else f"+{0.05 * (self.upper - self.lower):.2g}"

    def in_steps(self, value: float) -> float:
        """How many typical steps ``value`` lies above the initial value."""
        return self._above(value, self.initial) / self._step

    def at_steps(self, steps: float) -> float:
        """The inverse of `in_steps`; it may lie outside the bounds."""
        return self._moved(self.initial, steps * self._step)

    def a_step_aside(self, value: float, steps: float = 1.0) -> float:
        """``value`` so many typical steps higher, or lower where there is more room; kept inside the bounds."""
        here = self.in_steps(value)
        rises = self.in_steps(self.upper) - here >= min(steps, here - self.in_steps(self.lower))
        return self.project(self.at_steps(here + (steps if rises else -steps)))

    @property
    def _step(self) -> float:
        """`typical_step` on the parameter's own scale."""
        return math.log(1.1) if self.scale == "log" else float(self.typical_step)

    def _above(self, value: float, base: float) -> float:
        """How far ``value`` lies above ``base``, on the parameter's own scale."""
        return math.log(value / base) if self.scale == "log" else value - base

    def _moved(self, base: float, amount: float) -> float:
        """The inverse of `_above`: the value that lies so far above ``base``."""
        return base * math.exp(amount) if self.scale == "log" else base + amount

    def project(self, value: float) -> float:
        """The nearest value inside the bounds."""
        return min(max(value, self.lower), self.upper)

    def to_unit(self, value: float) -> float:
        """Where ``value`` lies between the bounds, 0 to 1, on this parameter's own scale."""
        return self._above(value, self.lower) / self._above(self.upper, self.lower)

    def bound_at(self, value: float) -> str:
        """``"lower"`` or ``"upper"`` where ``value`` is within a thousandth of the range of it, else empty."""
        place = self.to_unit(value)
        return "lower" if place <= _AT_BOUND else "upper" if place >= 1.0 - _AT_BOUND else ""

    @property
    def length(self) -> float:
        """The unit of `coordinate`, on the parameter's own scale."""
        return self._above(self.upper, self.lower) if self.deviation is None else self.deviation

    @property
    def origin(self) -> float:
        """Where `coordinate` is 0: the mean of the prior, else where the search starts."""
        return self.initial if self.expected is None else self.expected

    def coordinate(self, value: float) -> float:
        """How many deviations ``value`` lies above the origin, on this parameter's own scale."""
        return self._above(value, self.origin) / self.length

    def at_coordinate(self, u: float) -> float:
        """The inverse of `coordinate`, kept inside the bounds."""
        return self.project(self._moved(self.origin, u * self.length))

    def from_unit(self, position: float) -> float:
        """The inverse of `to_unit`, kept inside the bounds against rounding."""
        return self.project(self._moved(self.lower, position * self._above(self.upper, self.lower)))


@dataclass(frozen=True)
class ParameterSpace:
    """The searched parameters, in a fixed order."""

    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        seen: set[str] = set()
        for parameter in self.parameters:
            if parameter.name in seen:
                raise BsaError(f'"{parameter.name}" stands twice in the search space.', "name each parameter once.")
            seen.add(parameter.name)

    def __len__(self) -> int:
        return len(self.parameters)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.parameters)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise BsaError(
            f'"{name}" is not in the search space.', did_you_mean(name, self.names) or f"it holds {list(self.names)}."
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def targets(self) -> dict[str, Target]:
        """What each parameter acts on, by its name."""
        return {parameter.name: parameter.target or Value(parameter.name) for parameter in self}

    def change(self, candidate: Candidate) -> CellChange:
        """What a candidate changes about the cell, sorted by target."""
        return change_of(self.targets, candidate)

    @property
    def initial(self) -> dict[str, float]:
        """The candidate at which a search starts."""
        return {parameter.name: parameter.initial for parameter in self}

    def started(self, values: Candidate) -> ParameterSpace:
        """The same space, searched from other values; parameters that are not among them start where they did."""
        return ParameterSpace(tuple(replace(one, initial=values.get(one.name, one.initial)) for one in self))

    def continued(self, found: Candidate) -> ParameterSpace:
        """The same space, searched from what a fit has found.

        Priors stay where they are: counted as known before, what a fit found would count its records twice.
        """
        origins = [replace(one, expected=one.origin) if one.prior else one for one in self]
        return ParameterSpace(tuple(origins)).started(found)

    def project(self, candidate: Candidate) -> dict[str, float]:
        """The projection Π of the paper (Eq. 4): each value to its nearest bound."""
        return {parameter.name: parameter.project(candidate[parameter.name]) for parameter in self}

    def to_unit(self, candidate: Candidate) -> FloatArray:
        """The candidate in the unit box, shape (p,), each axis on its parameter's own scale."""
        return np.array([parameter.to_unit(candidate[parameter.name]) for parameter in self])

    def from_unit(self, position: FloatArray) -> dict[str, float]:
        """The candidate at a point of the unit box, shape (p,); points outside are projected."""
        return {
            parameter.name: parameter.from_unit(float(value)) for parameter, value in zip(self, position, strict=True)
        }

    @property
    def lowest(self) -> FloatArray:
        """Coordinates of the lower bounds, shape (p,)."""
        return np.array([parameter.coordinate(parameter.lower) for parameter in self])

    @property
    def highest(self) -> FloatArray:
        """Coordinates of the upper bounds, shape (p,)."""
        return np.array([parameter.coordinate(parameter.upper) for parameter in self])

    @property
    def prior_weights(self) -> FloatArray:
        """Cost of a unit of each coordinate, shape (p,): 1 where the parameter has a prior, else 0."""
        return np.array([1.0 if parameter.prior else 0.0 for parameter in self])

    def at(self, u: FloatArray) -> dict[str, float]:
        """The candidate at coordinates of shape (p,), in deviations from the origins."""
        return {parameter.name: parameter.at_coordinate(float(value)) for parameter, value in zip(self, u, strict=True)}

    def steps_between(self, start: Candidate, end: Candidate) -> FloatArray:
        """How many typical steps each parameter rises from ``start`` to ``end``, shape (p,)."""
        return np.array([p.in_steps(end[p.name]) - p.in_steps(start[p.name]) for p in self])

    def sample(self, rng: np.random.Generator) -> dict[str, float]:
        """A candidate drawn evenly from the unit box."""
        return self.from_unit(rng.random(len(self)))
