"""What the records fix, in the words that the command line and the report share."""

from collections.abc import Sequence

from ...core.comparison.residuals import DURATION_TOLERANCE
from ...core.domain import Domain
from ...core.inference.measure_next import Suggestion
from ...core.inference.post_fit_analysis import PostFitAnalysis
from ...core.metrics import Metrics, objective_of
from ...core.printable import counted
from ...core.run.answer import weighs_score
from ...core.task import Task
from ...core.trial import Trial
from .wording import number, short_name, unit

_NAMED = 6
"""Parameters that one line names; the report's table has all."""

_WORTH_MEASURING = 0.9
"""Share of the widest interval that a protocol must come below to be advised: less is not worth hours of a cycler."""

_LONGER = "With more --simulations the analysis is longer, also where the search does not use them."


def best_score_line(task: Task, best: Trial, lowest: Trial, metrics: Metrics | None) -> str:
    """Which simulation has a better score than the one that is reported, and why; empty if none has.

    ``best`` is the run's answer, ``lowest`` the simulation with the lowest objective, ``metrics`` its final scores.
    """
    if lowest is best or metrics is None:
        return ""
    objective = objective_of(task)
    theirs, lowest_misfit = (number(trial.misfit, 3) for trial in (best, lowest))
    begin = f"These are the values of simulation {best.index}{' (the starting point)' * (best.phase == 'initial')}"
    lowest_score = f"the lowest {objective.words}, {number(objective.shown(metrics))} {objective.unit}"
    if weighs_score(task, best):
        why = (
            f", which has the least product of misfit, {theirs} tolerances (rms), and {objective.words}: so far from "
            f"the noise of the record each alone may be least where a step is cut short. Simulation {lowest.index} has "
            f"{lowest_score}, and a misfit of {lowest_misfit}"
        )
    elif best.misfit > lowest.misfit:
        why = (
            f", the most probable ones: simulation {lowest.index} has {lowest_score}, and a misfit of {lowest_misfit} "
            f"in place of {theirs} tolerances (rms), but is farther from the priors of the search space"
        )
    else:
        minimised = "means of the error over parts of each step" if task.given_drive else "errors within each step"
        why = (
            f": the fit minimises the {minimised}, which are {theirs} tolerances (rms) there and {lowest_misfit} in "
            f"simulation {lowest.index}, which has {lowest_score}"
        )
    return f"{begin}{why}. {tolerance_line(task)}"


def verdict_line(analysis: PostFitAnalysis, ended: bool = False) -> str:
    """``"The record fixes 2 of 24 parameters: ..., ...; 18 are loose; 4 are open: ..."``; many names are a number.

    ``ended`` is whether the fit ended by itself, so that it would not use more simulations.
    """
    found = analysis.identifiability
    doubt = _doubt(analysis, ended)
    begin = f"{doubt} With them the record" if doubt else "The record"
    if len(found.open) == len(found.intervals):
        if len(found.intervals) == 1:
            return f"{begin} does not fix {named(found.open)}: it is open."
        return f"{begin} fixes none of the {len(found.intervals)} parameters: all are open."

    def listed(names: Sequence[str]) -> str:
        return f": {named(names)}" if 0 < len(names) <= _NAMED else ""

    number_of = counted(len(found.intervals), "parameter")
    parts = [f"{begin} fixes {len(found.fixed)} of {number_of}{listed(found.fixed)}"]
    for names, state in ((found.loose, "loose"), (found.open, "open")):
        if names:
            parts.append(f"{len(names)} {'is' if len(names) == 1 else 'are'} {state}{listed(names)}")
    return "; ".join(parts) + "."


def _doubt(analysis: PostFitAnalysis, ended: bool) -> str:
    """What keeps the intervals from being the record's, in a sentence or two; empty if nothing does."""
    if analysis.unsettled:
        settle = "To settle it, let the run go on with more simulations."
        if ended:
            settle = (
                "No step that the fit tried gained what was predicted, so it would not use more simulations. Fewer "
                "searched parameters, or a further record, may settle it."
            )
        return (
            f"The fit has not settled: {_named_or_counted(analysis.unsettled, analysis)} would move by more than the "
            f"interval with another step, so the intervals say little in either direction. {settle}"
        )
    if apart := analysis.identifiability.apart:
        return (
            "The fit stopped short of the likeliest values, about which the intervals lie: "
            f"{_named_or_counted(apart, analysis)} "
            f"{'is' if len(apart) == 1 else 'are'} outside. {'A' if ended else 'More simulations, or a'} run that "
            "begins elsewhere may come nearer."
        )
    if _widened(analysis):
        return "The analysis stopped before its sample converged, so intervals are wider than the record's."
    return ""


def _widened(analysis: PostFitAnalysis) -> bool:
    """Whether the intervals were widened by so much that the factor, told to two digits, is more than 1."""
    return round(analysis.widened, 1) > 1.0


def _named_or_counted(names: Sequence[str], analysis: PostFitAnalysis) -> str:
    of_all = f"{len(names)} of {len(analysis.identifiability.intervals)} parameters"
    return named(names) if len(names) <= _NAMED else of_all


def caution_line(analysis: PostFitAnalysis) -> str:
    """What the analysis did where its sample did not converge; empty if it did, or if that made no difference."""
    if not _widened(analysis):
        return ""
    # Beside a fit that has not settled, an interval as wide as a linear estimate is no wider than it should be.
    wide = "" if analysis.unsettled else ", and every interval is at least as wide as a linear estimate"
    allowed = f"to allow for that, the assumed noise was multiplied by {number(analysis.widened, 2)}{wide}."
    if not analysis.cut_short:
        return (
            f"After {analysis.simulations} simulations of the analysis, as many as it makes, draws of the parameters "
            f"did not come out as predicted; {allowed}"
        )
    why = f"it makes {analysis.budget} at most, as many as the search may make"
    if analysis.simulations > analysis.budget:
        why = f"more than the search may make, {analysis.budget}, it makes only where it cannot do without"
    return (
        f"The analysis stopped after {counted(analysis.simulations, 'simulation')} ({why}), before its sample of the "
        f"parameters had converged; {allowed} {_LONGER}"
    )


def ended_by_itself(status: str, lacking: str) -> bool:
    """Whether a search of this status, which lacked simulations for so much, would not use more of them."""
    return status == "finished" and not lacking


def needs_more(analysis: PostFitAnalysis, ended: bool = False) -> bool:
    """Whether more simulations would tell more than an analysis could; ``ended`` as for `verdict_line`."""
    near = not (analysis.unsettled or analysis.identifiability.apart)
    cut_short = _widened(analysis) and analysis.cut_short
    return bool(not (near or ended) or cut_short or analysis.forgone)


def groups_line(analysis: PostFitAnalysis) -> str:
    """Which parameters cannot be told apart; empty if all can."""
    groups = [named(group) for group in analysis.identifiability.correlated]
    return f"Known only together: {'; '.join(groups)}." if groups else ""


def next_line(analysis: PostFitAnalysis, domain: Domain) -> str:
    """What to measure next and what it would do; empty if nothing was found that helps."""
    if analysis.forgone:
        told = caution_line(analysis)
        return (
            f"What to measure next was not looked for: the analysis lacked {counted(analysis.forgone, 'simulation')} "
            "for it." + f" {_LONGER}" * (_LONGER not in told)
        )
    if not analysis.measure_next:
        return ""
    first = analysis.measure_next[0]
    now = analysis.identifiability.intervals[analysis.worst].share_of_range
    if first.worst_share_of_range > _WORTH_MEASURING * now:
        of_all = len(analysis.measure_next)
        considered = f"None of the {of_all} protocols considered" if of_all > 1 else "No protocol considered"
        return (
            f"{considered} would narrow the widest interval "
            f"({half_width(now)} of the range of {short_name(analysis.worst)}) by a tenth: what is open needs another "
            "kind of measurement, or a value from elsewhere."
        )
    length = f"{number(first.hours, 2)} h {domain.start_of_next}".strip()
    return (
        f"To measure next: {first.name} ({length}): the widest 95 % interval would go "
        f"from {half_width(now)} of its range ({short_name(analysis.worst)}) to "
        f"{half_width(first.worst_share_of_range)} ({short_name(first.worst)})."
    )


def tolerance_words(task: Task) -> str:
    """``"1 mV, 0.1 % of a duration, about 1 % of the current"``: what a tolerance is in this task."""
    several = len(task.observed) > 1
    parts = [
        f"{number(signal.shown_scale * signal.tolerance)} {unit(signal.shown)}" + f" of {signal.words}" * several
        for signal in task.observed
        if not signal.relative
    ]
    if not task.given_drive:
        parts.append(f"{number(100.0 * DURATION_TOLERANCE)} % of a duration")
    answering = [signal for signal in task.driven if signal.observed_in and not task.given_drive]
    shares = [signal for signal in (*task.observed, *answering) if signal.relative]
    words = [
        f"about {number(100.0 * signal.tolerance)} % of the {signal.share_of or signal.words}" for signal in shares
    ]
    return ", ".join([*parts, *dict.fromkeys(words)])


def tolerance_line(task: Task) -> str:
    """What the unit of the misfit is, in a sentence."""
    return f"One tolerance is {tolerance_words(task)}."


def steps_of(suggestion: Suggestion) -> str:
    """The steps of a protocol in a line, a repeated pair of steps once."""
    cycles = []
    for cycle in suggestion.protocol:
        times = len(cycle) // 2 if len(cycle) > 2 and cycle == cycle[:2] * (len(cycle) // 2) else 1
        steps = cycle[:2] if times > 1 else cycle
        cycles.append(", ".join(steps) + (f"; {times} times" if times > 1 else ""))
    return "; then ".join(cycles)


def half_width(of_range: float) -> str:
    """Half an interval's width as it is told: ``"± 12 %"``; an interval may be wider than the range."""
    return f"± {number(100.0 * of_range, 2)} %"


def named(names: Sequence[str]) -> str:
    """Parameters by their short names."""
    return ", ".join(short_name(name) for name in names)
