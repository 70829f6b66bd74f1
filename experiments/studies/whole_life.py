"""A measured life foretold from its beginning: ``python -m bsa.experiments.studies.whole_life FOLDER``.

CALCE's cells CS2_35 and CS2_36 (LCO, 1.1 A h, charged at C/2 to 4.2 V, discharged at 1C to 2.7 V), by their tables of
cycles. Two parameters are fitted to the capacities of the first cycles: the size of the cell, and how fast an SEI
whose growth is limited by solvent diffusion takes its lithium. The rest of the life is simulated.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...core.ageing.cycle_table import CycleTable
from ...core.files import write_csv
from ...core.fit_settings import Settings
from ...core.least_squares import LeastSquares, solve
from ...core.parameters import Candidate, Parameter, ParameterSpace
from ...core.target import Value
from ...core.task import CellModel, Experiment
from ...core.trajectory import FloatArray, Trajectory
from ...plugins.pybamm.long_experiment import LongExperiment
from ...plugins.pybamm.parameter_sets import initial_value, pybamm

CELLS = ("CS2_35", "CS2_36")
FITTED, FORETOLD = 200, 500

_CYCLE = (
    "Charge at 0.55 A until 4.2 V",
    "Hold at 4.2 V until 50 mA",
    "Rest for 10 minutes",
    "Discharge at 1.1 A until 2.7 V",
    "Rest for 10 minutes",
)
_WIDTH, _GROWTH = "Electrode width [m]", "SEI solvent diffusivity [m2.s-1]"
_SET = "Ai2020"
_SIZE = 0.466
"""Of the set's cell, 2.28 A h: where the search for the size starts."""

_CELL = CellModel(
    _SET,
    "SPM",
    {"SEI": "solvent-diffusion limited", "contact resistance": "true"},
    # The cell's own window, with room for what rests do beyond it; the contacts of the set's cell count for none.
    {"Lower voltage cut-off [V]": 2.6, "Upper voltage cut-off [V]": 4.3, "Contact resistance [Ohm]": 0.05},
)

_CUT_SHORT = 0.97
"""Share of the capacity of the cycles around it below which a cycle was cut short, as 30 to 38 of each life were."""

_AROUND = 15
_TOLERANCE_AH = 0.01
_BUDGET = 40
_WORTH = 1e-2
"""Share of the cost that is worth a step: what is left then is scatter."""
_BESIDE = 0.02
"""Share of a parameter's range by which it is moved to see what its uncertainty does to the end of the life."""


@dataclass(frozen=True)
class Foretold:
    """The capacity of one cycle."""

    cell: str  # Which.
    fitted_to: int  # The last cycle of the fit.
    cycle: int  # Its number.
    # measured_ah, predicted_ah: Its capacity, A.h.
    measured_ah: float
    predicted_ah: float
    # low_ah, high_ah: 95 % band of a single cycle: of the parameters, and of the scatter about the fit.
    low_ah: float
    high_ah: float


def read_table(path: Path) -> CycleTable:
    """A life's table, without cycles that were cut short."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [(float(row["cycle"]), float(row["Qd_Arbin"])) for row in csv.DictReader(file)]
    cycle, capacity = np.array(rows).T
    padded = np.pad(capacity, _AROUND // 2, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, _AROUND), axis=1)
    whole = capacity > _CUT_SHORT * usual
    nothing = np.full(int(np.count_nonzero(whole)), np.nan)
    return CycleTable(cycle[whole], capacity[whole], nothing, nothing)


def space() -> ParameterSpace:
    """What is fitted."""
    width = _SIZE * initial_value(_SET, _WIDTH)
    return ParameterSpace(
        (
            Parameter(_WIDTH, width, 0.8 * width, 1.25 * width, "log", Value(_WIDTH)),
            Parameter(_GROWTH, 1e-19, 1e-21, 1e-17, "log", Value(_GROWTH)),
        )
    )


def foretell(cell: str, table: CycleTable) -> Iterator[Foretold]:
    """Fit the first cycles of a life and say how it goes on."""
    searched, known = space(), table.up_to(FITTED)
    simulate = _life(FITTED, searched)

    def residual(point: FloatArray) -> FloatArray | None:
        found = simulate(searched.from_unit(point))
        return None if found is None else (found[known.cycle.astype(int) - 1] - known.capacity_ah) / _TOLERANCE_AH

    search = LeastSquares(searched.to_unit(searched.initial), settings=Settings(ends_on_fresh=True, tolerance=_WORTH))
    solve(search, lambda points: [residual(point) for point in points], _BUDGET)
    assert search.residual is not None
    assert search.jacobian is not None
    scatter = _TOLERANCE_AH * float(np.std(search.residual))
    # Pauses and temperature leave residuals that go on for tens of cycles: so many fewer of them are independent.
    alike = float(np.corrcoef(search.residual[:-1], search.residual[1:])[0, 1])
    inflated = scatter**2 * (1.0 + alike) / (1.0 - alike)
    covariance = inflated * np.linalg.inv(search.jacobian.T @ search.jacobian * _TOLERANCE_AH**2)
    whole = _life(FORETOLD, searched)
    best = whole(searched.from_unit(search.point))
    assert best is not None
    slopes = []
    for direction in _BESIDE * np.eye(len(searched)):
        moved = whole(searched.from_unit(search.point - direction))
        assert moved is not None
        slopes.append((best - moved) / _BESIDE)
    jacobian = np.array(slopes).T
    half = 1.96 * np.sqrt(np.einsum("ni,ij,nj->n", jacobian, covariance, jacobian) + scatter**2)
    for cycle in range(50, FORETOLD + 1, 50):
        measured = float(table.at(np.array([float(cycle)]))[0])
        middle, side = float(best[cycle - 1]), float(half[cycle - 1])
        yield Foretold(cell, FITTED, cycle, measured, middle, middle - side, middle + side)


def _life(count: int, searched: ParameterSpace) -> Callable[[Candidate], FloatArray | None]:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("life", nothing, (_CYCLE,) * count, detailed_cycles=(1, count))
    life = LongExperiment(_CELL, experiment, searched.targets)

    def simulate(candidate: Candidate) -> FloatArray | None:
        run = life.solve(candidate)
        if run.failure is not None or run.trajectory is None or run.trajectory.cycle_table is None:
            return None
        return run.trajectory.cycle_table.capacity_ah

    return simulate


if __name__ == "__main__":
    pybamm.set_logging_level("CRITICAL")
    folder = Path(sys.argv[1])
    rows = [row for cell in CELLS for row in foretell(cell, read_table(folder / f"{cell}_percycle.csv"))]
    write_csv(Path("whole_life.csv"), [asdict(row) for row in rows])
