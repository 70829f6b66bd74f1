"""``bsa bench whole-life``: measured lives forecast from their beginning.

CALCE's cells CS2_35 and CS2_36 (LCO, 1.1 A h), each as ``bsa-run --life --fit-cycles`` takes it: the first cycles are
fitted, the later ones forecast.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...backends.opening import open_backend
from ...core.task import Task
from ..campaign.summary import Row, grouped
from ..campaign.text_tables import bold, brief, markdown_table
from ..read_options import reading
from ..run import execute_run
from ..run_record import RunRecord, read_run
from ..run_settings import run_config
from ..task_request import CellChoice, Records, task_of_records

CELLS = ("CS2_35", "CS2_36")
_RECORD = "calce_cs2/{}_all.csv.gz"
FITTED, LAST_CYCLE, EVERY = 200, 500, 50

SET, MODEL, _SCAFFOLD = "Ai2020", "SPM", "ageing"
_SIMULATIONS, _SEED = 80, 1234


def record_of(cell: str, data: Path) -> Path:
    """The whole life of one of CALCE's cells, in the folder of all records."""
    return data.absolute() / _RECORD.format(cell)


def items(data: Path) -> dict[str, dict[str, Any]]:
    """What is asked of each cell."""
    return {cell: {"cell": cell, "record": record_of(cell, data)} for cell in CELLS}


def task_of_life(record: Path) -> Task:
    """The task of a measured life, as ``bsa-run --life`` makes it."""
    records = Records([record], reads=[reading(cycles=f"1-{LAST_CYCLE}")], fit_cycles=FITTED)
    return task_of_records(records, CellChoice(SET, MODEL))


def forecast(folder: Path, cell: str, record: Path) -> dict[str, Any]:
    """Fit the first cycles of a life and forecast the later ones."""
    config = run_config(_SCAFFOLD, "rules", {}, {"rounds": _SIMULATIONS, "simulations": _SIMULATIONS, "seed": _SEED})
    run = folder / "run"
    execute_run(task_of_life(record), config, run, open_backend("rules", {}), analysing=True)
    rows = list(rows_of(cell, read_run(run)))
    return {"rows": rows, "summary": f"{_off_pct(rows[-1]):+.1f} % off at cycle {rows[-1]['cycle']}"}


def rows_of(cell: str, run: RunRecord) -> Iterator[dict[str, Any]]:
    """What a run says of the capacity of every fiftieth cycle, beside what was measured.

    The 95 % band is that of a single cycle: of the parameters, and of the scatter about the fit.
    """
    (prediction,) = run.held_out
    tables = [e.target.cycle_table for e in (*run.task.experiments, *run.task.held_out)]
    simulated = None if prediction.curve is None else prediction.curve.cycle_table
    assert simulated is not None
    for cycle in range(EVERY, LAST_CYCLE + 1, EVERY):
        at = np.array([float(cycle)])
        measured = [float(table.at(at)[0]) for table in tables if table is not None]
        middle = float(simulated.at(at)[0])
        half = float("nan") if prediction.fade is None else float(prediction.fade.at(at)[0])
        yield {
            "cell": cell,
            "fitted_to": FITTED,
            "cycle": cycle,
            "measured_ah": float(np.nanmax(measured)),
            "predicted_ah": middle,
            "low_ah": middle - half,
            "high_ah": middle + half,
        }


def forecast_table(rows: Sequence[Row]) -> str:
    """Measured and predicted capacities, a line a cycle, and how far off each cell is."""
    fitted, cells = rows[0]["fitted_to"], grouped(rows, "cell")
    lines: dict[str, list[str]] = {}
    for row in rows:
        if row["cycle"] > fitted or not row["cycle"] % 100:
            cycle = f"{row['cycle']:.0f}" + (" (fitted)" if row["cycle"] <= fitted else "")
            predicted = f"{row['predicted_ah']:.3f} ({row['low_ah']:.3f} to {row['high_ah']:.3f})"
            off = bold(f"{_off_pct(row):+.1f} %", not _inside(row))
            lines.setdefault(cycle, []).extend([f"{row['measured_ah']:.3f}", predicted, off])
    heads = [words for cell in cells for words in (f"{cell}, A h", "predicted (95 % band)", "off by")]
    remarks = []
    for cell, own in sorted(cells.items()):
        later = [row for row in own if row["cycle"] > fitted]
        off_by = [abs(_off_pct(row)) for row in later]
        remarks.append(
            f"* {cell}: {brief(off_by[-1])} % off at cycle {later[-1]['cycle']:.0f} (aim: 2 %), {brief(max(off_by))} % "
            f"at most; the band holds {sum(map(_inside, later))} of {len(later)} cycles after the fit (bold: not)."
        )
    table = markdown_table(["cycle", *heads], ([cycle, *entries] for cycle, entries in lines.items()))
    return "\n\n".join([table, "\n".join(remarks)])


def _off_pct(row: Row) -> float:
    return float(100.0 * (row["predicted_ah"] / row["measured_ah"] - 1.0))


def _inside(row: Row) -> bool:
    return bool(row["low_ah"] <= row["measured_ah"] <= row["high_ah"])
