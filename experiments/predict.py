"""``bsa predict``: a finished run scored on records that it never saw."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..core.comparison.record_errors import misfits
from ..core.contracts.registry import installed
from ..core.errors import BsaError
from ..core.files import write_json, write_text
from ..core.hooks import RunContext
from ..core.inference.prediction import predict
from ..core.run.later_simulations import NOT_FITTED, WatchedSimulations
from ..core.run.listener import SILENT, Listener
from ..core.run.run_plugins import RunPlugins
from ..core.scaffold import Scaffold
from ..core.task import Experiment
from .new_folder import new_folder
from .run_names import named_after, numbered_folder
from .run_record import RunRecord, read_run
from .task_request import Records
from .tasks.record_request import RecordRequest
from .tasks.records import holding_out

RESULT, PAGE = "prediction.json", "prediction.html"

_FITTED = "the run's report has its errors, and so have result.json and .record_errors of the result."


@dataclass(frozen=True, eq=False)
class ScoredRecords:
    """Records that a run did not fit, as its best candidate predicts them."""

    run: RunRecord  # The run; it holds out these records in place of those that it held out itself.
    notes: tuple[str, ...] = ()  # What was assumed or repaired of these records, and what is worth noticing.

    def to_json(self) -> dict[str, Any]:
        """What ``prediction.json`` holds."""
        return {
            "run": self.run.name,
            "task": self.run.task.name,
            "trial": self.run.best.index,
            "parameters": dict(self.run.best.candidate),
            "records": [{"fitted": False, **prediction.as_json()} for prediction in self.run.held_out],
            "notes": list(self.notes),
        }


def predicted(
    run: Path, records: Records, out: Path | None, workers: int = 1, listener: Listener = SILENT, band: bool = True
) -> tuple[ScoredRecords, Path]:
    """Score records that a run did not fit, and the page on them in a new or empty folder.

    The folder is one of the run's own where ``out`` is None. Raises `BsaError` as `predict_records`, and before
    anything is simulated if the folder cannot be used.
    """
    from .report.page import render_prediction

    place = out or numbered_folder(run / "predictions", named_after(records.sources))
    with new_folder(place) as folder:
        scored = predict_records(run, records.requests(), workers, listener, band)
        write_json(folder / RESULT, scored.to_json(), indent=2)
        write_text(folder / PAGE, render_prediction(scored.run))
    return scored, place / PAGE


def predict_records(
    folder: Path,
    requests: Sequence[RecordRequest],
    workers: int = 1,
    listener: Listener = SILENT,
    band: bool = True,
) -> ScoredRecords:
    """Simulate records and impedance spectra with the best candidate of a run.

    ``band`` is whether what the fitted parameters leave open is simulated too. A spectrum is that of the cell at the
    state of charge at which the fitted cell shows its voltage, if its request names none. Raises `BsaError` if the
    folder holds no run, no simulation of it succeeded, or a record cannot be read or was fitted.
    """
    run = read_run(folder)
    if not run.best.ok:
        raise BsaError(f"no simulation of {folder} ran to its end.", "a run that fits nothing predicts nothing.")
    notes = tuple(note for note in run.task.notes if not _of_one(note, run.task.held_out))
    task = holding_out(replace(run.task, held_out=(), notes=notes), requests, _FITTED)
    scaffold = Scaffold.model_validate(
        {"name": "predict", "simulator": run.config["scaffold"]["simulator"], "proposer": "default"}
    )
    context = RunContext(task, int(run.config["seed"]), folder, None, workers, listener.cycled)
    plugins = RunPlugins(scaffold, context, installed())
    watched = WatchedSimulations(plugins, listener.counted, variants=NOT_FITTED)
    draws = () if run.analysis is None or not band else run.analysis.identifiability.draws
    try:
        found = predict(task, run.best.candidate, task.held_out, watched, draws, misfits(run.records))
    finally:
        plugins.close()
    return ScoredRecords(replace(run, task=task, held_out=found), task.notes[len(notes) :])


def _of_one(note: str, held_out: Sequence[Experiment]) -> bool:
    """Whether a note is of one of the records that were held out; of a life the held-out part has more of a name."""
    name, mark, _ = note.partition(" (held out): ")
    return bool(mark) and any(experiment.name.startswith(name) for experiment in held_out)
