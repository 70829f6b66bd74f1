"""``prediction.html``: how well a run predicts records that it never saw."""

from ..run_record import RunRecord
from .figures import prediction_overlays
from .page import MOST_STEPS
from .records import error_rows
from .templates import template


def render(run: RunRecord) -> str:
    """The page as HTML: the records that were fitted, for comparison, and those of ``run.held_out``."""
    return template("prediction.html.j2").render(
        run=run,
        domain=run.task.domain,
        rows=error_rows(run.task, run.records, run.held_out),
        most_steps=MOST_STEPS,
        predictions=prediction_overlays(run.task, run.held_out),
    )
