"""What a model may lack: a named effect with its equation, its parameters and its signature in the voltage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .errors import BsaError
from .parameters import Parameter, Scale
from .target import EffectValue
from .trajectory import FloatArray

_DIFFERENCE = 0.25
"""Finite-difference step of an effect's parameter, in units of its deviation."""

Values = Mapping[str, float]
"""The parameters of one effect by their short names."""


@dataclass(frozen=True)
class EffectParameter:
    """A parameter that exists only when its effect does.

    Attributes
    ----------
    name : str
        Short name, unique within the effect: ``"resistance"``.
    unit : str
        Unit in PyBaMM's notation, empty for a pure number.
    null : float
        The value at which the effect is absent (for a parameter other than the strength: its default).
    lower, upper : float
        Physical bounds. A strength whose null is also a bound has a sign that nature allows.
    probe : float
        A small but visible strength: where the score test switches the effect on, and where a refit starts.
    scale : {'linear', 'log'}
        The axis of the fit.
    of : tuple of float and str
        What a value of 1 is, where the parameter is a pure number: ``(2.5e-22, "m2.s-1")``. Reports multiply by it.
    """

    name: str
    unit: str
    null: float
    lower: float
    upper: float
    probe: float
    scale: Scale = "linear"
    of: tuple[float, str] = (1.0, "")

    def __post_init__(self) -> None:
        if not self.lower <= self.null <= self.upper or not self.lower <= self.probe <= self.upper:
            raise BsaError(
                f'"{self.name}": null {self.null:g} and probe {self.probe:g} must lie in '
                f"[{self.lower:g}, {self.upper:g}].",
                "widen the bounds.",
            )


@dataclass(frozen=True)
class Measurement:
    """An effect of the instrument rather than of the cell, applied to what the model predicts.

    Attributes
    ----------
    clock : callable or None
        ``clock(time, values)``: the times (s) at which the cell really was when the record says ``time``.
    voltage : callable or None
        ``voltage(voltage, current, values)``: what the instrument writes down, V.
    """

    clock: Callable[[FloatArray, Values], FloatArray] | None = None
    voltage: Callable[[FloatArray, FloatArray, Values], FloatArray] | None = None


@dataclass(frozen=True)
class Evidence:
    """What the records of a discovery can show at all.

    Attributes
    ----------
    model : str
        The base model, ``"SPM"``, ``"SPMe"`` or ``"DFN"``.
    options : mapping
        Its options; an effect that they already contain is not missing.
    cycles : int
        The largest number of cycles in one record.
    temperature_span_k : float
        Difference between the warmest and the coldest the cell is known to have been, K.
    sampling_s : float
        Shortest interval between samples next to a current step, s.
    life : bool
        Whether the mechanism is asked for that ages a cell over the cycles of one record.
    """

    model: str
    options: Mapping[str, Any]
    cycles: int
    temperature_span_k: float
    sampling_s: float
    life: bool = False


@dataclass(frozen=True)
class Effect:
    """A physical or measurement effect that can be added to a model.

    Attributes
    ----------
    name : str
        Public name, lower case and hyphens: ``"contact-resistance"``.
    title : str
        The same in plain words.
    equation : str
        What is added, as a formula.
    parameters : tuple of EffectParameter
        The first is the strength: at its null value the effect is absent, whatever the others are.
    signature : str
        How the effect shows in the voltage, in words.
    citation : str
        Where the equation comes from, with a DOI.
    variant : str
        Tells apart kinds of one effect (``"reaction-limited"``); empty for most.
    physics : object
        How a simulator adds it; opaque to the core.
    measurement : Measurement or None
        For effects of the instrument.
    lacks : callable or None
        ``lacks(evidence)`` returns why these records cannot show the effect (or why the model already
        has it), or an empty string.
    on_request : bool
        Whether it is considered only where it is named: what imitates most others would leave nothing else to find.
    ages : bool
        Whether it changes the cell from cycle to cycle: what a whole life is asked for.
    """

    name: str
    title: str
    equation: str
    parameters: tuple[EffectParameter, ...]
    signature: str
    citation: str
    variant: str = ""
    physics: Any = None
    measurement: Measurement | None = None
    lacks: Callable[[Evidence], str] | None = field(default=None, compare=False)
    on_request: bool = False
    ages: bool = False

    @property
    def key(self) -> str:
        """Name and variant: unique in a catalogue."""
        return f"{self.name} ({self.variant})" if self.variant else self.name

    @property
    def entry_name(self) -> str:
        """The key as plugins are named, ``"ocp-shape.negative-electrode"``."""
        return f"{self.name}.{self.variant.replace(' ', '-')}" if self.variant else self.name

    def is_called(self, name: str) -> bool:
        """Whether a person's name means this effect; that without a variant means all variants."""
        return name in (self.name, self.key, self.entry_name)

    def lacking(self, evidence: Evidence) -> str:
        """Why records cannot show it, or the model already has it; empty if neither is so."""
        return "" if self.lacks is None else self.lacks(evidence)

    @property
    def strength(self) -> EffectParameter:
        """The parameter whose null value switches the effect off."""
        return self.parameters[0]

    def full_name(self, parameter: EffectParameter) -> str:
        """The parameter's name in a candidate: ``"contact-resistance: resistance [Ohm]"``."""
        unit = f" [{parameter.unit}]" if parameter.unit else ""
        return f"{self.name}: {parameter.name}{unit}"

    def values(self, candidate: Values) -> dict[str, float]:
        """The parameters of this effect in a candidate, by short name; null values where the candidate is silent."""
        return {p.name: float(candidate.get(self.full_name(p), p.null)) for p in self.parameters}

    def held_at(self, values: Values) -> Effect:
        """The effect with other values for those of its parameters, by full name, of which a candidate is silent."""
        held = [replace(p, null=values.get(self.full_name(p), p.null)) for p in self.parameters]
        return replace(self, parameters=tuple(held))

    @property
    def searched(self) -> tuple[Parameter, ...]:
        """The parameters as a search space sees them, starting at the probe.

        Only those on a log scale have a prior, of a factor of two: a null value is no likelier than another.
        """
        return tuple(
            Parameter(
                self.full_name(p),
                p.probe,
                p.lower,
                p.upper,
                p.scale,
                EffectValue(self.name, p.name),
                math.log(2.0) if p.scale == "log" else abs(p.probe - p.null) or 0.1 * (p.upper - p.lower),
                prior=p.scale == "log",
                difference=_DIFFERENCE,
            )
            for p in self.parameters
        )
