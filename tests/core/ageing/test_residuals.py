"""Residuals of a life: its table decides as much as all of its curves."""

from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.residuals import CAPACITY_TOLERANCE, compared_cycles
from bsa.core.comparison.residuals import capacity_rows, residuals
from bsa.core.simulation import Outcome
from bsa.core.task import Task
from bsa.core.trajectory import Trajectory

Record = Callable[..., Trajectory]


def test_the_rows_of_capacity_are_found(
    record: Record, task: Callable[[Trajectory], Task], outcome: Callable[[Trajectory], Outcome]
) -> None:
    target, simulated = record(fade=1e-3), record(fade=2e-3)
    (rows,) = capacity_rows(task(target))
    assert target.cycle_table is not None
    cycles = target.cycle_table.cycle[compared_cycles(target.cycle_table)]
    found = residuals(task(target), outcome(simulated))
    assert found is not None
    expected = ((1.0 - 2e-3 * (cycles - 1)) / (1.0 - 1e-3 * (cycles - 1)) - 1.0) / CAPACITY_TOLERANCE
    np.testing.assert_allclose(found[rows], expected, rtol=1e-6, atol=1e-9)


def test_curves_count_together_as_much_as_the_table(
    record: Record, task: Callable[[Trajectory], Task], outcome: Callable[[Trajectory], Outcome]
) -> None:
    target = record(fade=1e-3)
    off = target.changed(voltage=target.voltage + 0.005)  # 5 tolerances everywhere, the durations as they are
    found = residuals(task(target), outcome(off))
    assert found is not None
    table_rows = 2 * len(capacity_rows(task(target))[0])  # capacity and resistance
    # Three steps of a voltage: 16 points and a duration each.
    assert float(found @ found) == pytest.approx(table_rows * 25.0 * 16 / 17, rel=0.02)
