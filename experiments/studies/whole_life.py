"""Measured lives forecast from their beginning: ``python -m bsa.experiments.studies.whole_life FOLDER``.

CALCE's cells CS2_35 and CS2_36 (LCO, 1.1 A h), each as ``bsa-run --life --fit-cycles`` takes it: the first cycles are
fitted, the later ones forecast. The runs are kept in the folder ``whole_life``; an interrupted one goes on.
"""

import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...backends.opening import open_backend
from ...core.files import write_csv
from ...core.record import ReadOptions
from ..run import execute_run
from ..run_record import RunRecord, read_run
from ..run_settings import run_config
from ..task_request import CellChoice, Records, task_of_records

CELLS = ("CS2_35", "CS2_36")
FITTED, FORETOLD, EVERY = 200, 500, 50

SET, MODEL, _SCAFFOLD = "Ai2020", "SPM", "ageing"
_SIMULATIONS, _SEED = 80, 1234


@dataclass(frozen=True)
class Foretold:
    """The capacity of one cycle."""

    cell: str
    fitted_to: int  # The last cycle of the fit.
    cycle: int
    measured_ah: float
    predicted_ah: float
    # low_ah, high_ah: 95 % band of a single cycle: of the parameters, and of the scatter about the fit.
    low_ah: float
    high_ah: float


def forecast(data: Path, folder: Path) -> RunRecord:
    """Fit the first cycles of a life and forecast the later ones."""
    records = Records([data], reads=[ReadOptions(cycles=(1, FORETOLD))], fit_cycles=FITTED)
    task = task_of_records(records, CellChoice(SET, MODEL))
    config = run_config(_SCAFFOLD, "rules", {}, {"rounds": _SIMULATIONS, "simulations": _SIMULATIONS, "seed": _SEED})
    execute_run(task, config, folder, open_backend("rules", {}), analysing=True)
    return read_run(folder)


def rows_of(cell: str, run: RunRecord) -> Iterator[Foretold]:
    """What a run says of every fiftieth cycle, beside what was measured."""
    (prediction,) = run.held_out
    tables = [e.target.cycle_table for e in (*run.task.experiments, *run.task.held_out)]
    simulated = None if prediction.curve is None else prediction.curve.cycle_table
    assert simulated is not None
    for cycle in range(EVERY, FORETOLD + 1, EVERY):
        at = np.array([float(cycle)])
        measured = [float(table.at(at)[0]) for table in tables if table is not None]
        middle = float(simulated.at(at)[0])
        half = float("nan") if prediction.fade is None else float(prediction.fade.at(at)[0])
        yield Foretold(cell, FITTED, cycle, float(np.nanmax(measured)), middle, middle - half, middle + half)


if __name__ == "__main__":
    where, out = Path(sys.argv[1]), Path("whole_life")
    runs = {cell: forecast(where / f"{cell}_all.csv.gz", out / cell) for cell in sys.argv[2:] or CELLS}
    write_csv(Path("whole_life.csv"), [asdict(row) for cell, run in runs.items() for row in rows_of(cell, run)])
