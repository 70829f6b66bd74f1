"""The report's section on simulations that failed: how far each got, what stopped it, what was done about it."""

from collections import Counter
from typing import Any

from ...core.metrics import objective_of
from ...core.printable import counted, were
from ...core.trial import Trial
from ..run_record import RunRecord
from .wording import clipped, duration, number

_MOST_ROWS = 40


def failures(run: RunRecord) -> dict[str, Any] | None:
    """What a run's failures amount to; None if nothing failed or was reduced."""
    shown = [trial for trial in run.trials if trial.failed or trial.reduction is not None]
    if not shown:
        return None
    rows = [_row(run, trial) for trial in shown[:_MOST_ROWS]]
    return {"summary": _summary(run), "remedy": _remedy(run), "rows": rows, "left_out": len(shown) - _MOST_ROWS}


def failure_words(trial: Trial) -> str:
    """Why a simulation failed and which limit was near; empty if it did not."""
    if not trial.failed:
        return ""
    if trial.failure is None:
        return "nothing to compare"
    limit = f"; {trial.failure.limit}" if trial.failure.limit else ""
    return clipped(trial.failure.cause + limit, 500)


def _summary(run: RunRecord) -> str:
    failed = [trial for trial in run.trials if trial.failed]
    reduced = sum(trial.reduction is not None for trial in run.trials)
    text = f"{len(failed)} of {counted(len(run.trials), 'simulation')} failed"
    if reduced:
        count = "counts" if reduced == 1 else "count"
        text += f"; {reduced} {were(reduced)} of a reduced task, which {count} as simulations but never as a fit"
    limits = Counter(
        part.partition(" (")[0]  # without its numbers
        for trial in failed
        if trial.failure is not None and trial.failure.limit and not trial.failure.limit.startswith("no limit")
        for part in trial.failure.limit.split("; ")
    )
    if limits:
        text += ". Near their end: " + ", ".join(
            f"{limit} ({counted(count, 'time')})" for limit, count in limits.most_common(4)
        )
    return text + "."


def _remedy(run: RunRecord) -> list[str]:
    """What was tried until something simulated, each sentence once with how many simulations it took."""
    if not run.initial.failed:
        return []
    spent: dict[str, int] = {}
    for round_ in run.rounds:
        words = clipped(round_.rationale or round_.hypothesis or round_.action, 300)
        spent[words] = spent.get(words, 0) + len(round_.trials)
        good = next((trial for trial in round_.trials if trial.ok), None)
        if good is not None:
            error = f"{number(good.objective)} {objective_of(run.task).of_unit}"
            found = f"Simulation {good.index} ran to its end, with {error}."
            break
    else:
        found = "Nothing was found that runs to its end."
    return [*(f"{words} ({counted(count, 'simulation')})" for words, count in spent.items()), found]


def _row(run: RunRecord, trial: Trial) -> dict[str, Any]:
    failure = trial.failure
    where = "initial" if trial.phase == "initial" else f"{trial.phase} {trial.round}"
    if trial.reduction is not None:
        where += f", {trial.reduction.words}"
    step = "" if failure is None or not failure.step else f"{failure.step} (cycle {failure.cycle})"
    limit = "ran to its end" if failure is None else failure_words(trial)
    return {"index": trial.index, "place": where, "reached": _reached(run, trial), "step": step, "limit": limit}


def _reached(run: RunRecord, trial: Trial) -> str:
    got = sum(curve.duration for curve in trial.curves if curve is not None)
    if trial.reduction is not None:
        return duration(got)
    wanted = sum(experiment.target.duration for experiment in run.task.experiments)
    return f"{duration(got)} ({number(100.0 * got / wanted, 2)} % of the record)" if wanted > 0 else duration(got)
