"""The parts of records that stages look at."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.cell import CELL, CURRENT, VOLTAGE
from bsa.core.comparison.residuals import DURATION_TOLERANCE, rows_of, tolerance_at
from bsa.core.scaffold import load_scaffold
from bsa.core.task import Experiment
from bsa.core.trajectory import Step, StepKind, Trajectory
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


def test_under_a_protocol_a_percent_of_the_current_of_a_hold_counts_as_much_as_a_percent_of_the_voltage() -> None:
    hour = np.linspace(0.0, 3600.0, 73)
    current = np.concatenate([np.full(73, -1.0), -np.exp(-hour / 1500.0)])
    steps = (Step(StepKind.CC_CHARGE, 0, 73), Step(StepKind.CV_HOLD, 73, 146, position=1))
    record = Trajectory(np.concatenate([hour, 3600.0 + hour]), current, np.full(146, 4.0), steps=steps)
    protocol = (("Charge at 1 A until 4 V", "Hold at 4 V until 0.09 A"),)
    task = replace(toy_task(), signals=CELL.signals, experiments=(Experiment("charge", record, protocol, None),))
    rows, view = rows_of(task), view_of(task, "everything")
    voltage, amperes = rows.signal == "voltage", rows.signal == "current"
    assert set(rows.step[voltage]) == {0}
    assert set(rows.step[amperes]) == {1}
    percent = np.where(voltage, 0.01 * 4.0 / VOLTAGE.tolerance, 0.0)
    there = np.exp(-rows.since_s[amperes] / 1500.0)
    percent[amperes] = 0.01 * there / tolerance_at(CURRENT, there, task.experiments[0])
    seen = view(percent)
    assert seen[amperes] @ seen[amperes] == pytest.approx(seen[voltage] @ seen[voltage], rel=1e-3)
    ended = replace(task.experiments[0], target=record.changed(current=np.where(current > -0.2, 0.0, current)))
    weights = view_of(replace(task, experiments=(ended,)), "everything").weights
    assert np.all(np.isfinite(weights))
    assert np.array_equal(weights[amperes] == 0.0, there < 0.2)
