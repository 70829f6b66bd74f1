"""Search spaces: by the name of a preset, or parameter by parameter as a person writes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, model_validator

from ....core.errors import BsaError, unknown
from ....core.parameters import Parameter, ParameterSpace, Scale
from ....core.target import Factor, Value, factor_name, target_named
from ....core.task import ParameterSource
from ....core.validation import validated
from ....core.yaml_text import YAML_SUFFIXES, read_yaml
from ..cells.nameplate import nominal_capacity_ah
from ..cells.parameter_sets import initial_value, is_function, load, target_in

PRESETS_FILE = Path(__file__).with_name("search_presets.yaml")


class Range(BaseModel, extra="forbid"):
    """How one parameter is searched; exactly one of the three kinds of bounds."""

    factors: tuple[float, float] | None = Field(None, description="Bounds as multiples of the set's own value.")
    bounds: tuple[float, float] | None = Field(None, description="Bounds, widened to hold the set's own value.")
    volts_at_1c: tuple[float, float] | None = Field(None, description="A resistance's bounds, as volts lost at 1C.")
    scale: Scale = Field("linear", description="linear or log.")
    at_most: float | None = Field(None, description="No bound above this.")
    deviation: float | None = Field(None, gt=0, description="Standard deviation of a normal prior, of ln on log scale.")
    start: float | None = Field(None, description="Initial value, in the units of the bounds, where the set has 0.")
    needs: dict[str, list[str]] = Field(default_factory=dict, description="Model options it takes part with.")
    number_only: bool = Field(False, description="Left out where the set has a function: that was measured.")
    if_present: bool = Field(False, description="Left out where the set lacks it.")

    @model_validator(mode="after")
    def _one_kind_of_bounds(self) -> Range:
        if sum(kind is not None for kind in (self.factors, self.bounds, self.volts_at_1c)) != 1:
            raise ValueError("give one of factors, bounds and volts_at_1c")
        return self

    def takes_part(self, options: Mapping[str, Any]) -> bool:
        """Whether a model with these options has the parameter in its equations."""
        return all(_meets(options.get(option), values) for option, values in self.needs.items())


class Preset(BaseModel, extra="forbid"):
    """A named search space."""

    summary: str = Field(description="One line.")
    includes: list[str] = Field(default_factory=list, description="Presets above it whose parameters it has too.")
    parameters: dict[str, Range] = Field(description="How each parameter is searched.")


class OwnRange(BaseModel, extra="forbid"):
    """How a user searches one parameter."""

    initial: float | None = Field(None, description="Where the search starts; the set's own value if left out.")
    lower: float | None = Field(None, description="Lower bound.")
    upper: float | None = Field(None, description="Upper bound.")
    factors: tuple[float, float] | None = Field(None, description="Bounds as multiples of the initial value.")
    scale: Scale | None = Field(None, description="linear or log; log if left out and factors are given.")
    deviation: float | None = Field(None, gt=0, description="Standard deviation of a normal prior, of ln on log scale.")

    @model_validator(mode="after")
    def _whole_bounds(self) -> OwnRange:
        if self.factors is not None and (self.lower is not None or self.upper is not None):
            raise ValueError("give either factors, or lower and upper")
        if (self.lower is None) != (self.upper is None):
            raise ValueError("lower and upper go together")
        return self


@cache
def presets() -> Mapping[str, Preset]:
    """The presets by name."""
    found: dict[str, Preset] = {}
    for name, content in read_yaml(PRESETS_FILE).items():
        own = Preset.model_validate(content)
        ranges = {key: entry for other in own.includes for key, entry in found[other].parameters.items()}
        found[name] = own.model_copy(update={"parameters": {**ranges, **own.parameters}})
    return found


def preset_space(
    parameter_set: ParameterSource,
    preset_name: str,
    overrides: Mapping[str, float] | None = None,
    options: Mapping[str, Any] | None = None,
) -> ParameterSpace:
    """The search space of a preset around a parameter set.

    The preset is one of `presets`, such as ``"cell"`` or ``"geometry"``. ``overrides`` replace values of the
    set, and the search starts from them; parameters that take no part with PyBaMM's model ``options``, and those whose
    range is multiples of a value that is 0, are left out.
    Raises `BsaError` if there is no such preset or parameter set, or none of the preset's parameters takes part.
    """
    known = presets()
    if preset_name not in known:
        listed = "presets: {}; or write the parameters in a .yaml file."
        raise unknown(f'there is no search preset "{preset_name}".', preset_name, known, listed)
    given = overrides or {}
    chosen = {
        name: entry
        for name, entry in known[preset_name].parameters.items()
        if entry.takes_part(options or {})
        and not (entry.number_only and name not in given and is_function(parameter_set, name))
        and not (entry.if_present and name not in load(parameter_set))
        and not (entry.factors and _is_zero(parameter_set, name, given))
    }
    if not chosen:
        raise BsaError(
            f'no parameter of "{preset_name}" takes part with the model options {dict(options or {})}.',
            "switch the effect on with a model option (for example SEI), or choose another preset.",
        )
    return ParameterSpace(tuple(_from_preset(parameter_set, name, entry, given) for name, entry in chosen.items()))


def resolve_space(
    parameter_set: ParameterSource,
    search: str | Mapping[str, Any],
    overrides: Mapping[str, float] | None = None,
    options: Mapping[str, Any] | None = None,
) -> ParameterSpace:
    """The search space that a person asked for.

    ``search`` is the name of a preset, the path of a YAML file, or what such a file holds: for each parameter
    ``{initial, lower, upper, scale}``, ``{factors: [0.5, 2]}``, ``[lower, upper]``, or nothing where a preset knows its
    range. ``overrides`` and ``options`` are as in `preset_space`. Raises `BsaError` naming the parameter or key at
    fault and the nearest valid one.
    """
    if not isinstance(search, str):
        return _own_space(parameter_set, search, "search", overrides or {})
    if is_preset(search):
        return preset_space(parameter_set, search, overrides, options)
    path = Path(search)
    content = read_yaml(path)
    if not isinstance(content, Mapping) or not content:
        raise BsaError(f"{path} holds no search space.", 'write one "parameter: {lower: ..., upper: ...}" a line.')
    return _own_space(parameter_set, content, str(path), overrides or {})


def is_preset(search: str | Mapping[str, Any]) -> bool:
    """Whether a search is meant as the name of a preset: not parameters with bounds, nor a file of them."""
    return isinstance(search, str) and Path(search).suffix not in YAML_SUFFIXES


def searches(search: str | Mapping[str, Any], name: str) -> bool:
    """Whether a search is by a preset that has this parameter."""
    preset = presets().get(search) if isinstance(search, str) else None
    return preset is not None and name in preset.parameters


def starts_given(search: str | Mapping[str, Any]) -> set[str]:
    """The parameters whose initial value the person has written: nothing may replace these."""
    content = search
    if isinstance(content, str):
        content = {} if is_preset(content) else read_yaml(Path(content))
    if not isinstance(content, Mapping):
        return set()
    entries = content.items()
    return {str(name) for name, entry in entries if isinstance(entry, Mapping) and entry.get("initial") is not None}


def _own_space(
    parameter_set: ParameterSource, content: Mapping[str, Any], where: str, overrides: Mapping[str, float]
) -> ParameterSpace:
    found: list[Parameter] = []
    for name, value in content.items():
        if isinstance(value, (list, tuple)) and len(value) == 2:
            value = {"lower": value[0], "upper": value[1]}
        entry = validated(OwnRange, {} if value is None else value, f'{where}: "{name}"')
        found.append(_from_person(parameter_set, str(name), entry, overrides))
    return ParameterSpace(tuple(found))


def _from_person(
    parameter_set: ParameterSource, name: str, entry: OwnRange, overrides: Mapping[str, float]
) -> Parameter:
    if entry.factors is None and entry.lower is None:
        known = _known_range(name)
        if known is None:
            # An unknown name is the likelier mistake: say that first.
            initial_value(parameter_set, name, overrides)
            raise BsaError(f'"{name}" has no bounds.', "give lower and upper, or factors: [0.5, 2].")
        if known.factors and _is_zero(parameter_set, _preset_name(name), overrides):
            raise BsaError(
                f'"{name}" is 0 in {parameter_set}, multiples of which are no range.', "give lower and upper."
            )
        parameter = _from_preset(parameter_set, _preset_name(name), known, overrides)
        if entry.deviation is not None:
            parameter = replace(parameter, deviation=entry.deviation, prior=True)
        if entry.initial is None:
            return parameter
        lower, upper = min(parameter.lower, entry.initial), max(parameter.upper, entry.initial)
        return replace(parameter, initial=entry.initial, lower=lower, upper=upper)
    initial, target = initial_value(parameter_set, name, overrides), target_in(parameter_set, name, overrides)
    scale: Scale
    if entry.factors is not None:
        initial = initial if entry.initial is None else entry.initial
        lower, upper = sorted(initial * factor for factor in entry.factors)
        scale = entry.scale or ("log" if lower > 0 else "linear")
    else:
        assert entry.lower is not None
        assert entry.upper is not None
        lower, upper, scale = entry.lower, entry.upper, entry.scale or "linear"
        initial = min(max(initial, lower), upper) if entry.initial is None else entry.initial
    return Parameter(name, initial, lower, upper, scale, target, entry.deviation, entry.deviation is not None)


def _from_preset(parameter_set: ParameterSource, name: str, entry: Range, overrides: Mapping[str, float]) -> Parameter:
    value = isinstance(target_named(name), Value)
    if value and name not in overrides and is_function(parameter_set, name):
        name = factor_name(name)
    initial = initial_value(parameter_set, name, overrides)
    unit = 1.0 if entry.volts_at_1c is None else 1.0 / nominal_capacity_ah(parameter_set, overrides)
    if entry.factors is not None:
        lower, upper = (initial * factor for factor in entry.factors)
    else:
        lower, upper = (unit * bound for bound in (entry.bounds or entry.volts_at_1c or ()))
        if initial == 0.0 and entry.start is not None:
            initial = unit * entry.start
    if entry.at_most is not None:
        upper = min(upper, entry.at_most)
    target = target_in(parameter_set, name, overrides)
    lower, upper = min(lower, initial), max(upper, initial)
    deviation = None if entry.deviation is None else unit * entry.deviation
    return Parameter(name, initial, lower, upper, entry.scale, target, deviation, deviation is not None)


def _is_zero(parameter_set: ParameterSource, name: str, overrides: Mapping[str, float]) -> bool:
    """Whether the set says that a number is 0, multiples of which are no range."""
    given = name in overrides or not is_function(parameter_set, name)
    return given and initial_value(parameter_set, name, overrides) == 0.0


def _preset_name(name: str) -> str:
    """The name under which presets keep a parameter's range: that of the function for a multiplier on it."""
    target = target_named(name)
    return target.name if isinstance(target, Factor) else name


def _known_range(name: str) -> Range | None:
    base = _preset_name(name)
    return next((preset.parameters[base] for preset in presets().values() if base in preset.parameters), None)


def _meets(value: Any, wanted: list[str]) -> bool:
    # Options given for each electrode apart are a pair; one that fits is enough.
    given = [str(item).casefold() for item in (value if isinstance(value, (list, tuple)) else [value or "none"])]
    if "!none" in wanted:
        return any(item != "none" for item in given)
    return any(item in wanted for item in given)
