"""Measured cells of public data sets, calibrated by one scaffold and scored on records that it never saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter

from ...backends.opening import open_backend
from ...core.errors import BsaError, did_you_mean
from ...core.loop import RunResult
from ...core.record_errors import RecordErrors
from ...core.run_config import RunConfig
from ...core.scaffold import load_scaffold
from ...core.yaml_text import read_yaml
from ..run import Resources, execute_run
from ..tasks.task_file import TaskFile, task_from

CELLS_FILE = Path(__file__).with_name("real_cells.yaml")


@dataclass(frozen=True)
class RecordRow:
    """One record of one cell; errors are those of the voltage, in mV, and NaN where nothing was simulated.

    A simulation that ended early has the errors of what it reached, and says why it ended.
    """

    cell: str
    record: str
    role: str
    rms_mv: float
    rms_99_mv: float
    max_mv: float
    start_mv: float
    simulations: int
    simulator_s: float
    failure: str


@cache
def cells() -> tuple[TaskFile, ...]:
    """The cells, in the order in which they are run."""
    return tuple(TypeAdapter(list[TaskFile]).validate_python(read_yaml(CELLS_FILE)))


def chosen(names: Sequence[str]) -> list[TaskFile]:
    """The cells of these names; all of them if there are none.

    Raises
    ------
    BsaError
        If there is no such cell.
    """
    known = {cell.name: cell for cell in cells()}
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known) or f"cells: {', '.join(known)}."
            raise BsaError(f'there is no measured cell "{name}".', hint)
    return [known[name] for name in names] or list(cells())


def missing(cell: TaskFile, data: Path) -> list[str]:
    """The records of a cell that are not in the folder."""
    return [entry.data for entry in (*cell.experiments, *cell.held_out) if not (data / entry.data).is_file()]


def run_cell(
    cell: TaskFile, data: Path, folder: Path, scaffold: str, simulations: int, seed: int, workers: int
) -> list[RecordRow]:
    """Calibrate a cell, or go on where that was interrupted; a row for each record."""
    task = task_from(cell, data)
    config = RunConfig(scaffold=load_scaffold(scaffold), simulations=simulations, seed=seed)
    result = execute_run(task, config, folder, open_backend("rules", {}), Resources(workers=workers))
    if result.status == "interrupted":
        raise KeyboardInterrupt
    held_out = [prediction.errors for prediction in result.held_out]
    return [
        _row(cell.name, errors, role, result)
        for role, found in (("fitted", result.records), ("held out", held_out))
        for errors in found
    ]


def _row(cell: str, errors: RecordErrors, role: str, result: RunResult) -> RecordRow:
    nothing = float("nan")
    voltage = errors.signals.get("voltage")
    before = result.initial_metrics.value("v_rmse_mv") if result.initial_metrics is not None else nothing
    return RecordRow(
        cell,
        errors.record,
        role,
        nothing if voltage is None else voltage.rms,
        nothing if voltage is None else voltage.rms_99,
        nothing if voltage is None else voltage.max,
        before if role == "fitted" else nothing,
        len(result.trials),
        result.simulator_s,
        errors.failure,
    )


def run_cells(
    wanted: Sequence[TaskFile], data: Path, out: Path, run: Callable[[TaskFile, Path], list[RecordRow]]
) -> tuple[list[RecordRow], list[str]]:
    """Run what has data; the rows, and a sentence for each cell that was skipped.

    Parameters
    ----------
    wanted : sequence of TaskFile
        The cells.
    data : Path
        Where their records are.
    out : Path
        Holds a folder for each cell.
    run : callable
        ``run(cell, folder)`` gives the rows of one.
    """
    rows: list[RecordRow] = []
    remarks: list[str] = []
    for cell in wanted:
        lacking = missing(cell, data)
        if lacking:
            remarks.append(f"{cell.name} is skipped: {data} lacks {', '.join(lacking)}.")
            continue
        try:
            rows += run(cell, out / cell.name.replace(" ", "-"))
        except BsaError as error:
            remarks.append(f"{cell.name} is skipped: {error.message}")
    return rows, remarks
