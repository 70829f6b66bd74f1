"""The views of a life."""

from dataclasses import replace

import numpy as np
from bsa.core.residuals import rows_of
from bsa.core.scaffold import load_scaffold
from bsa.plugins.proposers.stage_data import view_of
from bsa.plugins.proposers.staged import StagedOptions
from bsa.plugins.pybamm.presets import presets
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
