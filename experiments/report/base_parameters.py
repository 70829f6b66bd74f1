"""What a discovery fitted of the base model itself, beside the effects, as a table shows it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import numpy as np

from ...core.discovery.discovery import Discovery
from ...core.discovery.explanation import Explanation
from ...core.inference.problem import Problem
from ...core.normal import NORMAL_95
from ...core.parameters import Parameter
from ...core.trajectory import FloatArray
from .wording import NOTHING, number, printed_unit, quantity, short_name


@dataclass(frozen=True)
class BaseParameter:
    """A parameter of the base model, in words."""

    name: str
    value: str  # With its unit.
    interval: str  # 95 %, in that unit; a dash where none was made.
    before: str  # What was known before the fit, one standard deviation around its mean, or where the search started.
    flags: tuple[str, ...] = ()  # What is to be noticed of the value.


def base_parameters(discovery: Discovery, problem: Problem | None = None) -> list[BaseParameter]:
    """The leading explanation's own values of the base model, in the order of the fit.

    With the ``problem`` that was fitted they have intervals. A life's cell, fitted to its first cycle, leads.
    """
    best = discovery.findings.best
    of_effects = {effect.full_name(parameter) for effect in best.effects for parameter in effect.parameters}
    deviations = None if problem is None else _deviations(best, problem)
    half = np.full(len(best.fit.space), np.nan) if deviations is None else NORMAL_95 * deviations
    searched = [
        # Of a state of charge that the parameter set's cell, between its cut-offs at rest, does not have.
        _searched(parameter, float(u), float(width), ["outside 0 to 1"] * (parameter.name in best.beyond_window))
        for parameter, u, width in zip(best.fit.space, best.fit.u, half, strict=True)
        if parameter.name not in of_effects
    ]
    held = [name for name in discovery.parameters if name not in best.fit.space]
    return [*(_held(name, discovery.parameters[name]) for name in held), *searched]


def _deviations(best: Explanation, problem: Problem) -> FloatArray | None:
    """Standard deviations of the fit's coordinates, as those of the effects' parameters are; None where unknown."""
    weighed, systematic = best.fit.deviation, problem.systematic()
    if weighed is None or len(weighed) != len(systematic) or len(weighed) != len(best.sigma):
        return None
    misfit_v = float(np.sqrt(max(np.median(weighed**2 - best.sigma**2), 0.0)))
    covariance = best.fit.covariance(best.dispersion(misfit_v), systematic / weighed[:, None])
    return np.asarray(np.sqrt(np.diag(covariance)))


def _searched(parameter: Parameter, u: float, half: float, flags: Sequence[str]) -> BaseParameter:
    times, unit = printed_unit(parameter)

    def shown(value: float, digits: int = 4) -> str:
        return number(times * value, digits)

    value = parameter.at_coordinate(u)
    ends = [shown(parameter.at_coordinate(end)) for end in (u - half, u + half)] if np.isfinite(half) else []
    if not parameter.prior:
        before = f"none; search from {shown(parameter.origin)}"
    elif parameter.scale == "log":
        before = f"{shown(parameter.origin)}, × or ÷ {number(exp(parameter.length), 3)}"
    else:
        before = f"{shown(parameter.origin)} ± {shown(parameter.length, 3)}"
    at_bound = ["at a bound"] * bool(parameter.bound_at(value))
    moved = ["the interval excludes the value before"] * bool(parameter.prior and abs(u) > half)
    return BaseParameter(
        short_name(parameter.name),
        f"{shown(value)} {unit}".rstrip(),
        " to ".join(ends) or NOTHING,
        before,
        (*at_bound, *moved, *flags),
    )


def _held(name: str, value: float) -> BaseParameter:
    unit = Parameter(name, 0.0, -1.0, 1.0).unit
    return BaseParameter(short_name(name), quantity(value, unit), NOTHING, "fitted to the first cycle, then held")
