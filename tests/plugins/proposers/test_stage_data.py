"""The parts of records that stages look at."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.residuals import DURATION_TOLERANCE, rows_of
from bsa.core.scaffold import load_scaffold
from bsa.plugins.proposers.stage_data import view_of
from bsa.plugins.proposers.staged import StagedOptions
from bsa.plugins.pybamm.before_search.presets import presets
from bsa_toy_cell import toy_task
from bsa_toy_life import life, life_task


def test_the_first_cycle_and_the_life_after_it_are_the_whole_record() -> None:
    task = life_task(life(200, 0.2))
    rows = rows_of(task)
    first, later = view_of(task, "first-cycle"), view_of(task, "life")
    assert not first.lacking
    assert {task.experiments[0].target.steps[step].cycle for step in rows.step[first.rows]} == {1}
    assert sorted([*first.rows, *later.rows]) == list(range(len(rows.record)))
    # The table of cycles belongs to the life.
    assert len(rows.record) - 1 in later.rows


def test_a_record_of_one_cycle_has_no_life() -> None:
    task = life_task(life(200, 0.2))
    target = task.experiments[0].target.cycle(1)
    single = replace(task, experiments=(replace(task.experiments[0], target=target, detailed_cycles=()),))
    assert "one cycle" in view_of(single, "life").lacking
    assert np.all(view_of(single, "first-cycle").weights == 1.0)


def test_the_scaffold_for_ageing_puts_every_preset_parameter_where_it_shows() -> None:
    options = StagedOptions.model_validate(load_scaffold("ageing").proposer.options)
    cell, ageing, joint = options.plan
    for name in presets()["ageing"].parameters:
        assert ageing.takes(name), name
        assert not cell.takes(name), name
    for preset in ("cell", "geometry"):
        for name in presets()[preset].parameters:
            assert cell.takes(name), name
            assert not ageing.takes(name), name
    assert not joint.fits


def test_under_a_protocol_a_percent_of_a_step_counts_as_much_as_a_percent_of_the_whole_voltage() -> None:
    task = toy_task()
    (experiment,) = task.experiments
    rows, view = rows_of(task), view_of(task, "everything")
    (voltage,) = task.observed
    percent = 0.01 * np.mean(np.abs(experiment.target.voltage)) / voltage.tolerance
    curves = rows.signal != ""
    along = view(np.where(curves, percent, 0.0))
    for step in range(len(experiment.target.steps)):
        late = view(np.where(~curves & (rows.step == step), 0.01 / DURATION_TOLERANCE, 0.0))
        assert late @ late == pytest.approx(along @ along)
    # Under a measured current the durations are given, and the residuals count as they are.
    driven = replace(task, experiments=(replace(experiment, protocol=None),))
    assert np.all(view_of(driven, "everything").weights == 1.0)
