"""``bsa bench life-cost``: what a life costs, PyBaMM's own experiment against ours in one process.

Both simulate the published case ``sei-0`` (DFN, SEI limited by its reaction) at the search's tolerances.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.target import Value
from ...core.trajectory import FloatArray
from ...plugins.pybamm.cells.parameter_sets import load, pybamm
from ...plugins.pybamm.modelling.compiled_cell import make_model
from ...plugins.pybamm.modelling.resolution import SEARCH
from ...plugins.pybamm.solving.long_experiment import LongExperiment
from ..campaign.summary import Row
from ..campaign.text_tables import Entry, table_of
from ..suite.published import published_cases
from ..suite.target import cell_of, experiment_of

_MB = 1024.0
"""Linux tells the peak of a process's memory in kB."""

CASE = "sei-0"


def measure(folder: Path, cycles: int) -> dict[str, Any]:
    """Simulate a life with cycles left out, with all of them, and by PyBaMM's own experiment, in this order."""
    pybamm.set_logging_level("CRITICAL")
    case = published_cases(sei_cycles=cycles)[CASE]
    targets, found = {name: Value(name) for name in case.hidden}, []
    for way, leave_out in (("cycles left out", True), ("every cycle", False)):
        life = LongExperiment(cell_of(case), experiment_of(case), targets, leave_out=leave_out)
        seen: set[int] = set()
        times = []
        for _ in range(2 if leave_out else 1):
            started = time.process_time()
            run = life.solve(case.hidden, lambda step, cycle, seen=seen: seen.add(cycle))  # type: ignore[misc]
            times.append(time.process_time() - started)
        assert run.trajectory is not None
        assert run.trajectory.cycle_table is not None
        capacity = run.trajectory.cycle_table.capacity_ah
        found.append((way, len(seen), times[0], times[-1], _peak_mb(), capacity))
    started = time.process_time()
    plain = _plain(case)
    seconds = time.process_time() - started
    found.append(("PyBaMM's own experiment", cycles, seconds, seconds, _peak_mb(), plain))
    rows = [
        {
            "way": way,
            "cycles": cycles,
            "simulated": count,  # Cycles that were solved.
            # Processor time of the first evaluation, which builds and compiles, and of a later one.
            "first_s": first_s,
            "evaluation_s": later_s,
            "peak_mb": peak_mb,  # Largest memory of the process so far; the cheapest way comes first.
            # Largest difference of the capacity from that of PyBaMM's own experiment, by the first capacity.
            "fade_error_pct": 100.0 * float(np.max(np.abs(capacity - plain)) / plain[0]),
        }
        for way, count, first_s, later_s, peak_mb, capacity in found
    ]
    return {"rows": rows, "summary": f"{rows[0]['evaluation_s']:.1f} s with cycles left out"}


def _plain(case: Any) -> FloatArray:
    """Capacities by PyBaMM's `Simulation` of the whole experiment, as its documentation shows it."""
    cell, experiment = cell_of(case), experiment_of(case)
    values = load(cell.parameter_set)
    values.update(case.hidden)
    simulation = pybamm.Simulation(
        make_model(cell),
        experiment=pybamm.Experiment(list(experiment.protocol or ()), period="30 seconds"),
        parameter_values=values,
        solver=pybamm.IDAKLUSolver(rtol=SEARCH.rtol, atol=SEARCH.atol),
    )
    solution = simulation.solve(calc_esoh=False, showprogress=False)
    discharges = [cycle.steps[5]["Discharge capacity [A.h]"].entries for cycle in solution.cycles]
    return np.array([charge[-1] - charge[0] for charge in discharges])


def _peak_mb() -> float:
    import resource  # not on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _MB


def cost_table(rows: Sequence[Row]) -> str:
    """Each way of simulating the life, by the last one, PyBaMM's own."""
    plain_s = rows[-1]["evaluation_s"]
    columns: dict[str, Entry] = {
        "way": "{way}",
        "cycles solved": "{simulated:.0f} of {cycles:.0f}",
        "processor time": "{evaluation_s:brief} s",
        "times as cheap": lambda row: f"{plain_s / row['evaluation_s']:.1f}",
        "peak memory": "{peak_mb:.0f} MB",
        "largest capacity difference": "{fade_error_pct:brief} %",
    }
    return table_of(rows, columns)
