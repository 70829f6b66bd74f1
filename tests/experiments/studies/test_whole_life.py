"""The study of measured lives: what it reads off a run, and that it takes the files as the command does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.ageing.fade_band import FadeBand
from bsa.core.comparison.record_errors import RecordErrors
from bsa.core.inference.prediction import Prediction
from bsa.core.task import Task
from bsa.experiments.run_record import RunRecord
from bsa.experiments.studies import whole_life
from bsa.experiments.studies.whole_life import EVERY, FITTED, LAST_CYCLE, forecast, rows_of
from bsa.experiments.task_request import CellChoice, Records
from bsa_toy_life import life, life_task


class Stopped(Exception):
    """Nothing is simulated here."""


def part(task: Task, first: int, last: int) -> Task:
    """The task of some of the cycles of its life."""
    (experiment,) = task.experiments
    table = experiment.target.cycle_table
    assert table is not None
    kept = (table.cycle >= first) & (table.cycle <= last)
    columns = {name: getattr(table, name)[kept] for name in table.__dataclass_fields__}
    target = replace(experiment.target, cycle_table=replace(table, **columns))
    return replace(task, experiments=(replace(experiment, name=f"{first} to {last}", target=target),))


def test_every_fiftieth_cycle_is_told_with_its_band() -> None:
    whole = life(LAST_CYCLE, 0.25)
    task = life_task(whole)
    fitted, later = part(task, 1, FITTED), part(task, FITTED + 1, LAST_CYCLE).experiments
    cycles = np.arange(1.0, LAST_CYCLE + 1)
    fade = FadeBand(tuple(cycles), tuple(1e-4 * cycles))
    prediction = Prediction(RecordErrors("later", {}), {}, life(LAST_CYCLE, 0.2), 0, fade)
    run = RunRecord.__new__(RunRecord)
    object.__setattr__(run, "task", replace(fitted, held_out=later))
    object.__setattr__(run, "held_out", (prediction,))
    rows = list(rows_of("cell", run))
    assert [row["cycle"] for row in rows] == list(range(EVERY, LAST_CYCLE + 1, EVERY))
    last = rows[-1]
    assert last["measured_ah"] == pytest.approx(0.75)
    assert last["predicted_ah"] == pytest.approx(0.8)
    assert (last["low_ah"], last["high_ah"]) == (pytest.approx(0.75), pytest.approx(0.85))
    assert rows[0]["measured_ah"] == pytest.approx(1.0 - 0.25 * (EVERY - 1) / (LAST_CYCLE - 1))


def test_the_files_are_taken_as_the_command_takes_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: dict[str, object] = {}

    def task_of_records(records: Records, _: CellChoice) -> Task:
        asked.update(sources=records.sources, reads=records.reads, fit_cycles=records.fit_cycles)
        return life_task(life(20, 0.1))

    def execute_run(task: Task, config: object, *_: object, analysing: bool) -> None:
        asked.update(scaffold=config.scaffold.name, analysing=analysing)  # type: ignore[attr-defined]
        raise Stopped

    monkeypatch.setattr(whole_life, "task_of_records", task_of_records)
    monkeypatch.setattr(whole_life, "execute_run", execute_run)
    with pytest.raises(Stopped):
        forecast(tmp_path, "cell", Path("x.csv"))
    assert asked["sources"] == [Path("x.csv")]
    assert [read.options.cycles for read in asked["reads"]] == [(1, LAST_CYCLE)]  # type: ignore[attr-defined]
    assert (asked["fit_cycles"], asked["scaffold"], asked["analysing"]) == (FITTED, "ageing", True)
