"""``report.html``: what a run did, on one page that needs nothing else."""

import json
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...core.comparison.signal_metrics import MISFIT
from ...core.files import foreign, write_text
from ...core.metrics import Quantity, errors_of, headline_of, objective_of
from ...core.parameters import Parameter
from ...core.printable import counted
from ..run_record import UNFINISHED, RunRecord, read_run
from .ageing import lives
from .failures import failures
from .figures import convergence, overlays, prediction_overlays
from .identifiability import section
from .post_fit import best_score_line, tolerance_line
from .records import error_rows
from .reduced_potentials import reduced_line
from .rounds import chapters
from .search_misfit import search_misfits
from .templates import template
from .wording import change, clipped, factor, losses, number, printed_unit, short_name

FILE_NAME = "report.html"

_STATUS = {
    "converged": "converged: the goal was reached, or the last rounds brought no further improvement",
    "finished": "finished: the proposer had nothing better to offer",
    "rounds-spent": "ended: all rounds were used",
    "simulations-spent": "ended: all simulations were used",
    "budget-spent": "stopped: the allowance of tokens or money, or the replies to be repeated, were used up; the run "
    "can be resumed with more of them",
    "outage": "was stopped by an outage, the language model giving no reply: this is no result yet; it can be resumed",
    "interrupted": "interrupted; the run can be resumed",
    UNFINISHED: "not finished: still running, or killed; the run can be resumed",
}

_SHORT = "ended short of simulations"
"""Of a run that is finished, in place of its status."""

_MOST_NOTES = 100

_LONGEST_NOTE = 5000
"""Characters of a note of the run: a command with the names of many records is to be whole."""

MOST_STEPS = 40
"""Steps of a record that the page lists; a record of many cycles has thousands."""

_GENERATOR = b'<meta name="generator" content="battery-sim-agent">'
"""Stands in the head of every page."""

_HEAD_BYTES = 2048
"""The head of a page fits in."""


def build_report(folder: Path, out: Path | None = None) -> Path:
    """Write the report of a run.

    The journal in its folder is all that is read. The page, ``report.html`` in that folder by default, is written whole
    or not at all. Raises `BsaError` if there is no journal, it is damaged, or something else lies where the page is to
    be.
    """
    if out is not None:
        check_page(out)
    path = out or folder / FILE_NAME
    write_text(path, render(read_run(folder)))
    return path


def render(run: RunRecord) -> str:
    """The report as HTML."""
    objective = objective_of(run.task)
    parameters = [_parameter_row(parameter, run) for parameter in run.task.space]
    return template("report.html.j2").render(
        run=run,
        usage=run.usage,
        status=_SHORT if run.lacking and run.status != UNFINISHED else _STATUS.get(run.status, run.status),
        lacking=clipped(run.lacking, 600),
        useless=losses(run.unusable_replies, run.calls - run.lost_calls, run.lost_rounds),
        objective=objective,
        domain=run.task.domain,
        gain=change(objective.shown(run.initial_metrics), objective.shown(run.best_metrics)),
        tolerance=tolerance_line(run.task) if objective is MISFIT else "",
        headline=[_figure(run, quantity) for quantity in headline_of(run.task)],
        metrics=[
            *(_figure(run, quantity) for quantity in errors_of(run.task)),
            *(_row(quantity, *both) for quantity, both in search_misfits(run.task, run.initial, run.best).items()),
        ],
        lives=lives(run),
        overlays=overlays(run),
        rows=error_rows(run.task, run.records, run.held_out),
        most_steps=MOST_STEPS,
        predictions=prediction_overlays(run.task, run.held_out),
        convergence=convergence(run, objective),
        parameters=parameters,
        best_score=best_score_line(run.task, run.best, run.lowest, run.metrics_of(run.lowest)),
        at_bound=[row for row in parameters if row["bound"]],
        fixed=section(run),
        failures=failures(run),
        chapters=chapters(run),
        notes=_notes(run),
        config=json.dumps(run.config, indent=2, ensure_ascii=False),
    )


def _figure(run: RunRecord, quantity: Quantity) -> dict[str, str]:
    """A headline number before and after."""
    return _row(quantity, quantity.shown(run.initial_metrics), quantity.shown(run.best_metrics))


def _row(quantity: Quantity, before: float | None, after: float | None) -> dict[str, str]:
    return {
        "label": quantity.label,
        "before": number(before),
        "after": number(after),
        "unit": quantity.unit,
        "effect": change(before, after),
    }


def _parameter_row(parameter: Parameter, run: RunRecord) -> dict[str, Any]:
    """A line of the parameter table; ``start`` and ``place`` are shares of the range, on the parameter's own scale."""
    initial, best = run.initial.candidate[parameter.name], run.best.candidate[parameter.name]
    scale, shown_unit = printed_unit(parameter)
    return {
        "name": short_name(parameter.name),
        "unit": shown_unit,
        "initial": number(scale * initial),
        "best": number(scale * best),
        "factor": factor(initial, best),
        "lower": number(scale * parameter.lower),
        "upper": number(scale * parameter.upper),
        "start": min(max(parameter.to_unit(initial), 0.0), 1.0),
        "place": min(max(parameter.to_unit(best), 0.0), 1.0),
        "bound": parameter.bound_at(best),
    }


def _notes(run: RunRecord) -> Sequence[str]:
    """What the run and its backend had to say, each thing once."""
    reduced = reduced_line(run.task, run.best.candidate, run.simulator)
    notes = [clipped(note, _LONGEST_NOTE) for note in (*run.notes, *[reduced] * bool(reduced))]
    counts = Counter(note for exchange in run.exchanges if exchange.made_by == "model" for note in exchange.notes)
    notes += [clipped(f"{note} ({times} times)" if times > 1 else note, 600) for note, times in counts.items()]
    if run.lost_calls:
        notes.append(f"{run.lost_calls} of {run.calls} calls of the language model gave no reply.")
    if run.best_metrics is not None and not run.scored_exactly:
        notes.append(
            "Errors are those of the search: the run has not scored its best candidate with "
            f"{run.task.domain.accuracy}."
        )
    if run.resumed:
        notes.append(f"The run was taken up again {counted(run.resumed, 'time')}.")
    left_out = len(notes) - _MOST_NOTES
    if left_out > 0:
        notes = [*notes[:_MOST_NOTES], f"{left_out} more notes are in journal.jsonl."]
    return notes


def render_prediction(run: RunRecord) -> str:
    """``prediction.html``: how well a run predicts records that it never saw.

    The records that were fitted, for comparison, and those of ``run.held_out``.
    """
    return template("prediction.html.j2").render(
        run=run,
        domain=run.task.domain,
        rows=error_rows(run.task, run.records, run.held_out),
        most_steps=MOST_STEPS,
        predictions=prediction_overlays(run.task, run.held_out),
    )


def check_page(path: Path) -> None:
    """Refuse a path at which something else lies than a page of ours.

    Raises `BsaError` if there is a folder, a link or another file.
    """
    if not path.exists() and not path.is_symlink():
        return
    with suppress(OSError), path.open("rb") as file:
        if path.is_file() and _GENERATOR in file.read(_HEAD_BYTES):
            return
    raise foreign(path, "a page of ours")
