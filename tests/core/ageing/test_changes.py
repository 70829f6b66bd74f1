"""What changes over a life, and what does not."""

import numpy as np
import pytest
from bsa.core.ageing.changes import Changes
from bsa.core.comparison.residuals import residuals
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.trajectory import Trajectory
from bsa_toy_life import life, life_task

TASK = life_task(life(100, 0.2))


def changes_of(simulated: Trajectory, fit_cycles: int = 60) -> tuple[np.ndarray, Changes]:
    changes = Changes(TASK, fit_cycles)
    residual = residuals(TASK, Outcome((ExperimentRun(simulated),)))
    assert residual is not None
    return changes(residual), changes


def test_what_is_wrong_in_every_cycle_alike_is_no_change() -> None:
    record = TASK.experiments[0].target
    found, _ = changes_of(record.changed(voltage=record.voltage + 0.05))
    assert found == pytest.approx(0.0, abs=1e-9)


def test_a_fade_that_is_not_that_of_the_record_shows_and_grows() -> None:
    found, changes = changes_of(life(100, 0.3))
    assert np.sqrt(np.mean(found[changes.fitted] ** 2)) > 3.0
    assert np.sqrt(np.mean(found[changes.held] ** 2)) > 2.0 * np.sqrt(np.mean(found[changes.fitted] ** 2))


def test_later_cycles_are_held_out_of_curves_and_table() -> None:
    _, changes = changes_of(life(100, 0.2))
    kept = TASK.experiments[0].target.cycles
    table = changes.steps == changes.steps.max()
    of_curves = np.unique(changes.steps[changes.fitted & ~table])
    assert len(of_curves) == 2 * sum(cycle <= 60 for cycle in kept)
    assert 0 < np.count_nonzero(changes.held & table) < np.count_nonzero(changes.fitted & table)


def test_capacities_that_scatter_count_for_less() -> None:
    smooth = life(100, 0.2)
    assert smooth.cycle_table is not None
    noisy = smooth.cycle_table.capacity_ah * (1.0 + 0.01 * np.random.default_rng(0).standard_normal(100))
    table = type(smooth.cycle_table)(
        smooth.cycle_table.cycle, noisy, smooth.cycle_table.resistance_ohm, smooth.cycle_table.rested_voltage_v
    )
    task = life_task(Trajectory(smooth.time, smooth.current, smooth.voltage, None, smooth.steps, cycle_table=table))
    changes = Changes(task, 100)
    residual = residuals(task, Outcome((ExperimentRun(smooth),)))
    assert residual is not None
    capacities = changes(residual)[changes.steps == changes.steps.max()][:24]
    assert 0.5 < np.sqrt(np.mean(capacities**2)) < 2.0


def test_where_the_new_cell_is_off_a_change_counts_for_less() -> None:
    record = TASK.experiments[0].target
    new = residuals(TASK, Outcome((ExperimentRun(record.changed(voltage=record.voltage + 0.02)),)))
    aged = residuals(TASK, Outcome((ExperimentRun(life(100, 0.3)),)))
    assert new is not None
    assert aged is not None
    plain, weighed = Changes(TASK, 60)(aged), Changes(TASK, 60, new)(aged)
    off = np.abs(new) > 0.0
    assert np.all(np.abs(weighed[off]) <= 0.2 * np.abs(plain[off]) + 1e-12)
    assert weighed[~off] == pytest.approx(plain[~off])


def test_means_that_are_taken_off_cost_a_degree_of_freedom_each() -> None:
    _, changes = changes_of(life(100, 0.2))
    rng = np.random.default_rng(5)
    noise = [changes(changes._sigma * rng.normal(size=len(changes.fitted)))[changes.fitted] for _ in range(200)]
    left = np.count_nonzero(changes.fitted) - changes.common
    assert np.mean([seen @ seen for seen in noise]) == pytest.approx(left, rel=0.02)
