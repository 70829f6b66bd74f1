"""The report's section on what the record fixes."""

from typing import Any

from ...core.inference.post_fit_analysis import PostFitAnalysis
from ...core.parameters import Parameter
from ..run_record import RunRecord
from .post_fit import (
    caution_line,
    ended_by_itself,
    groups_line,
    half_width,
    named,
    next_line,
    steps_of,
    tolerance_words,
    verdict_line,
)
from .wording import number, printed_unit, short_name


def section(run: RunRecord) -> dict[str, Any] | None:
    """What a run found out after its search, as the template prints it; None if it did not look."""
    found = run.analysis
    if found is None:
        return None
    space = run.task.space
    return {
        "verdict": verdict_line(found, ended_by_itself(run.status, run.lacking)),
        "caution": caution_line(found),
        "groups": groups_line(found),
        "next": next_line(found, run.task.domain),
        "unknown": named(found.unknown),
        "rows": [_row(space[name], found) for name in found.identifiability.intervals if name in space],
        "protocols": [
            {
                "name": suggestion.name,
                "steps": steps_of(suggestion),
                "hours": number(suggestion.hours, 2),
                "worst": f"{half_width(suggestion.worst_share_of_range)} ({short_name(suggestion.worst)})",
            }
            for suggestion in found.measure_next
        ],
        "combinations": _combinations(found),
        "tolerance": tolerance_words(run.task),
        "noise": number(found.identifiability.noise, 2),
        "simulations": found.simulations,
        "reused": found.reused,
    }


def _row(parameter: Parameter, found: PostFitAnalysis) -> dict[str, Any]:
    """A parameter with its interval; ``start``, ``end`` and ``place`` are shares of the range, on its own scale."""
    interval = found.identifiability.intervals[parameter.name]
    scale, shown_unit = printed_unit(parameter)
    places = {"start": interval.lower, "end": interval.upper, "place": interval.value}
    return {
        "name": short_name(parameter.name),
        "unit": shown_unit,
        "value": number(scale * interval.value),
        "lower": number(scale * interval.lower),
        "upper": number(scale * interval.upper),
        "share": half_width(interval.share_of_range),
        "verdict": interval.verdict,
        "unsettled": parameter.name in found.unsettled,
        **{name: min(max(parameter.to_unit(value), 0.0), 1.0) for name, value in places.items()},
    }


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
        lines.append(f"{combination.verdict}, {half_width(combination.share_of_range)}: {text}")
    return lines
