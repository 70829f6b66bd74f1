"""Measured cells of public data sets, calibrated by one scaffold and scored on records that it never saw."""

import csv
import math
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from ...backends.opening import open_backend
from ...core.comparison.record_errors import RecordErrors
from ...core.comparison.signal_metrics import voltage_rmse_mv
from ...core.errors import BsaError, unknown
from ...core.reading.part_of_file import file_and_part
from ...core.run.loop import RunResult
from ...core.run.run_config import RunConfig
from ...core.scaffold import load_scaffold
from ...core.yaml_text import read_yaml
from ..run import Resources, execute_run
from ..tasks.task_file import TaskFile, task_from

MEASURED_CURRENT, PAPER = "real_cells", "paper_cells"
"""The studies, by the names of their files: driven by the measured current, or by the steps that the records show."""


Row = dict[str, Any]


def line_of(row: Row) -> str:
    """A row in words, on a line."""
    if "record" not in row:
        return (
            f"{row['cell']}: total MAPE {row['mape']:.2f} % (charge {row['q_mape']:.2f}, current {row['i_mape']:.2f}, "
            f"voltage {row['v_mape']:.2f}) from {row['start_mape']:.1f}"
        )
    kelvin = "" if math.isnan(row["rms_k"]) else f"; {row['rms_k']:.2f} K"
    return (
        f"{row['cell']}, {row['record']} ({row['role']}): {row['rms_mv']:.1f} mV rms, "
        f"{row['rms_99_mv']:.1f} over 99 % of the time{kelvin}"
    )


@cache
def cells(study: str = MEASURED_CURRENT) -> tuple[TaskFile, ...]:
    """The cells of a study, in the order in which they are run."""
    path = Path(__file__).with_name(f"{study}.yaml")
    return tuple(TypeAdapter(list[TaskFile]).validate_python(read_yaml(path)))


def chosen(names: Sequence[str], study: str = MEASURED_CURRENT) -> list[TaskFile]:
    """The cells of these names; all of them if there are none. Raises `BsaError` if there is no such cell."""
    known = {cell.name: cell for cell in cells(study)}
    for name in names:
        if name not in known:
            raise unknown(f'there is no measured cell "{name}".', name, known, "cells: {}.")
    return [known[name] for name in names] or list(cells(study))


def with_earlier(rows: Sequence[Row], path: Path, study: str = MEASURED_CURRENT) -> list[Row]:
    """Rows and, of the study's other cells, those that the file of an earlier call holds, in the study's order."""
    found = list(rows)
    run = {row["cell"] for row in rows}
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            earlier = [row for row in csv.DictReader(file) if row.get("cell") not in run]
        found += [{key: row.get(key, "") for key in found[0]} for row in earlier]
    order = [cell.name for cell in cells(study)]
    return sorted((row for row in found if row["cell"] in order), key=lambda row: order.index(row["cell"]))


def missing(cell: TaskFile, data: Path) -> list[str]:
    """The records of a cell that are not in the folder."""
    return [
        name
        for entry in (*cell.experiments, *cell.held_out)
        for name in entry.files
        if not file_and_part(data / name)[0].is_file()
    ]


def run_cell(
    cell: TaskFile, data: Path, folder: Path, scaffold: str, simulations: int, seed: int, workers: int
) -> list[Row]:
    """Calibrate a cell, or go on where that was interrupted; a row for each record, or one for its protocol."""
    task = task_from(cell, data)
    config = RunConfig(scaffold=load_scaffold(scaffold), simulations=simulations, seed=seed)
    # No row tells an interval, which would take as many simulations again.
    result = execute_run(task, config, folder, open_backend("rules", {}), Resources(workers=workers), analysing=False)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    if not task.given_drive:
        return [_protocol_row(cell.name, result)]
    held_out = [prediction.errors for prediction in result.held_out]
    return [
        _row(cell.name, errors, role, result)
        for role, found in (("fitted", result.records), ("held out", held_out))
        for errors in found
    ]


def _row(cell: str, errors: RecordErrors, role: str, result: RunResult) -> Row:
    """One record of a cell: errors of the voltage in mV and of the temperature in K, NaN where there are none.

    A simulation that ended early has the errors of what it reached, and says why it ended.
    """
    nothing = float("nan")
    voltage = errors.signals.get("voltage")
    kelvin = errors.signals.get("temperature")
    before = nothing if result.initial_metrics is None else voltage_rmse_mv(result.initial_metrics)
    return {
        "cell": cell,
        "record": errors.record,
        "role": role,
        "rms_mv": nothing if voltage is None else voltage.rms,
        "rms_99_mv": nothing if voltage is None else voltage.rms_99,
        "max_mv": nothing if voltage is None else voltage.max,
        "start_mv": before if role == "fitted" else nothing,
        "rms_k": nothing if kelvin is None else kelvin.rms,
        "simulations": len(result.trials),
        "simulator_s": result.simulator_s,
        "failure": errors.failure or "; ".join(errors.limits),
    }


def _protocol_row(cell: str, result: RunResult) -> Row:
    """One cell whose steps were simulated: the paper's errors in percent, charge, current and voltage apart."""
    before, after = result.initial_metrics, result.lowest_metrics  # the paper compares by the score
    return {
        "cell": cell,
        "start_mape": float("nan") if before is None else before.value("mape"),
        **{key: float("nan") if after is None else after.value(key) for key in _PAPER_ERRORS},
        "simulations": len(result.trials),
        "failed": sum(trial.failed for trial in result.trials),
        "simulator_s": result.simulator_s,
    }


_PAPER_ERRORS = ("mape", "q_mape", "i_mape", "v_mape", "v_rmse_mv")


def run_cells(
    wanted: Sequence[TaskFile], data: Path, out: Path, run: Callable[[TaskFile, Path], list[Row]]
) -> tuple[list[Row], list[str]]:
    """Run what has data; the rows, and a sentence for each cell that was skipped.

    ``run(cell, folder)`` gives the rows of one; its folder is in ``out``.
    """
    rows: list[Row] = []
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
