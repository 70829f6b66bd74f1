"""What a grid costs beside its runs: ``python tests/third_party_plugin/measure_grid.py 1000``.

Runs a grid of analytic cells in one local worker that is never replaced, and prints the wall time a cell
beyond the run itself, worker start included, and the worker's resident memory early and late.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml
from bsa.core.encoding import encode_task
from bsa.core.files import read_json
from bsa.experiments.campaign.cell import Report
from bsa.experiments.campaign.execution import Watcher
from bsa.experiments.campaign.local_pool import LocalPool
from bsa.experiments.campaign.running import Plan, plan_grid, run_campaign
from bsa.experiments.campaign.store import TRACE
from bsa_toy_cell import toy_task

_EARLY = 50


class Memory(Watcher):
    """Watches a grid and notes its worker's memory after each cell."""

    def __init__(self) -> None:
        self.after_mb: list[float] = []

    def __enter__(self) -> Memory:
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing to release."""

    def ended(self, cell: Any, report: Report, found: bool) -> None:
        """A cell came back."""
        self.after_mb.append(report.memory_mb)


def plan_toys(folder: Path, cells: int) -> Plan:
    """A grid of one analytic task and as many seeds as cells."""
    (folder / "toy.json").write_text(json.dumps(encode_task(toy_task())))
    content = {
        "name": "toys",
        "tasks": ["toy.json"],
        "scaffolds": ["full"],
        "seeds": list(range(cells)),
        "rounds": 2,
        "warm_up": 2,
        "simulations": 5,
        "settings": {"simulator.use": "toy-cell"},
    }
    (folder / "toys.yaml").write_text(yaml.safe_dump(content))
    return plan_grid(str(folder / "toys.yaml"), folder / "store")


def main(cells: int) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        plan = plan_toys(Path(folder), cells)
        memory = Memory()
        started = time.perf_counter()
        rows, _ = run_campaign(plan, LocalPool(1, cells_per_worker=cells + 1), memory)
        wall_s = time.perf_counter() - started
        traces = [read_json(plan.store.cell(cell.identity) / TRACE) or {} for cell in plan.cells]
        run_s = sum(float(trace["run_s"]) for trace in traces)
        done = sum(row["state"] == "done" for row in rows)
    print(f"{done} of {cells} cells done in {wall_s:.1f} s; the runs themselves took {run_s:.1f} s")
    print(f"overhead: {1e3 * (wall_s - run_s) / cells:.1f} ms a cell")
    early, late = memory.after_mb[min(_EARLY, cells) - 1], memory.after_mb[-1]
    print(f"memory of the worker: {early:.0f} MB after {min(_EARLY, cells)} cells, {late:.0f} MB after {cells}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
