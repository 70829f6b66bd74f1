"""The report's section on what the record fixes."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.parameters import Parameter
from ...core.post_fit_analysis import PostFitAnalysis
from ..run_record import RunRecord
from .post_fit import (
    caution_line,
    groups_line,
    named,
    next_line,
    share,
    steps_of,
    tolerance_words,
    verdict_line,
)
from .wording import number, short_name, unit


@dataclass(frozen=True)
class IntervalRow:
    """A parameter with its 95 % interval, printed."""

    name: str
    unit: str
    value: str
    lower: str
    upper: str
    share: str
    verdict: str
    # start, end, place: The interval's ends and the fitted value as shares of the range, on the parameter's own scale.
    start: float
    end: float
    place: float


@dataclass(frozen=True)
class NextRow:
    """A protocol that might be measured next, printed."""

    name: str
    steps: str
    hours: str
    worst: str


@dataclass(frozen=True)
class Section:
    """Everything the template prints."""

    verdict: str
    caution: str
    groups: str
    next: str
    unknown: str
    rows: list[IntervalRow]
    protocols: list[NextRow]
    combinations: list[str]
    tolerance: str
    noise: str
    simulations: int
    reused: int


def section(run: RunRecord) -> Section | None:
    """What a run found out after its search; None if it did not look."""
    found = run.analysis
    if found is None:
        return None
    return Section(
        verdict=verdict_line(found),
        caution=caution_line(found),
        groups=groups_line(found),
        next=next_line(found, run.task.domain),
        unknown=named(found.unknown),
        rows=[_row(run.task.space[name], found) for name in found.identifiability.intervals if name in run.task.space],
        protocols=[
            NextRow(
                suggestion.name,
                steps_of(suggestion),
                number(suggestion.hours, 2),
                f"{share(suggestion.forecast.worst_share)} ({short_name(suggestion.forecast.worst)})",
            )
            for suggestion in found.measure_next
        ],
        combinations=_combinations(found),
        tolerance=tolerance_words(run.task),
        noise=number(found.identifiability.noise, 2),
        simulations=found.simulations,
        reused=found.reused,
    )


def _row(parameter: Parameter, found: PostFitAnalysis) -> IntervalRow:
    interval = found.identifiability.intervals[parameter.name]
    micro = parameter.unit == "m" and 0 < parameter.upper < 1e-2
    scale = 1e6 if micro else 1.0
    return IntervalRow(
        name=short_name(parameter.name),
        unit="µm" if micro else unit(parameter.unit),
        value=number(scale * interval.value),
        lower=number(scale * interval.lower),
        upper=number(scale * interval.upper),
        share=share(interval.share_of_range),
        verdict=interval.verdict,
        start=min(max(parameter.to_unit(interval.lower), 0.0), 1.0),
        end=min(max(parameter.to_unit(interval.upper), 0.0), 1.0),
        place=min(max(parameter.to_unit(interval.value), 0.0), 1.0),
    )


def _combinations(found: PostFitAnalysis) -> list[str]:
    """The directions that the record does not fix, in words, worst first."""
    lines = []
    for combination in reversed(found.identifiability.combinations):
        if combination.verdict == "fixed":
            continue
        terms = [
            f"{'+' if weight > 0 else '−'} {number(abs(weight), 2)} {short_name(name)}"
            for name, weight in combination.weights.items()
        ]
        text = " ".join(terms).removeprefix("+ ")
        lines.append(f"{combination.verdict}, {share(combination.share_of_range)}: {text}")
    return lines
