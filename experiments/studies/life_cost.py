"""What a life costs, PyBaMM's own experiment against ours in one process.

``python -m bsa.experiments.studies.life_cost`` writes ``life_cost.csv``. Both simulate the published case ``sei-0``
(DFN, SEI limited by its reaction) at the search's tolerances.
"""

import resource
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_csv
from ...core.target import Value
from ...core.trajectory import FloatArray
from ...plugins.pybamm.cells.parameter_sets import load, pybamm
from ...plugins.pybamm.modelling.compiled_cell import make_model
from ...plugins.pybamm.modelling.resolution import SEARCH
from ...plugins.pybamm.solving.long_experiment import LongExperiment
from ..suite.published import published_cases
from ..suite.target import cell_of, experiment_of

_MB = 1024.0
"""Linux tells the peak of a process's memory in kB."""

_CASE = "sei-0"


@dataclass(frozen=True)
class LifeCost:
    """One way of simulating a life."""

    way: str  # Which.
    # cycles, simulated: Of the record, and of them solved.
    cycles: int
    simulated: int
    # first_s, evaluation_s: Processor time of the first evaluation, which builds and compiles, and of a later one, s.
    first_s: float
    evaluation_s: float
    peak_mb: float  # Largest memory of the process so far; the cheapest way comes first.
    # Largest difference of the capacity from that of PyBaMM's own experiment, in percent of the first capacity.
    fade_error_pct: float


def measure(cycles: int = 200) -> list[LifeCost]:
    """Simulate a life with cycles left out, with all of them, and by PyBaMM's own experiment, in this order."""
    pybamm.set_logging_level("CRITICAL")
    case = published_cases(sei_cycles=cycles)[_CASE]
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
    return [
        LifeCost(way, cycles, count, first, later, peak, 100.0 * float(np.max(np.abs(q - plain)) / plain[0]))
        for way, count, first, later, peak, q in found
    ]


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
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _MB


if __name__ == "__main__":
    write_csv(Path("life_cost.csv"), [asdict(cost) for cost in measure(int(sys.argv[1]) if sys.argv[1:] else 200)])
