"""A cell that is driven by its measured current."""

import time

import numpy as np
import pytest
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

(MARCUS,) = (effect for effect in EFFECTS if effect.key == "kinetics-marcus")


@pytest.mark.slow
def test_a_current_that_no_potential_gives_is_told_soon(rest_then_discharge):
    clock = np.arange(0.0, 4000.0, 20.0)
    record = rest_then_discharge(clock, 60.0, 1.7)
    cell = DrivenCell(CellModel("Chen2020", "SPMe"), (MARCUS,), record, {}, 298.15)
    (strength,) = (MARCUS.full_name(parameter) for parameter in MARCUS.parameters)

    def took(value: float) -> tuple[float, str]:
        start = time.process_time()
        response = cell.follow({strength: value}, clock, 0.9)
        return time.process_time() - start, response.cause

    took(0.0)  # compiles
    usual = max(took(0.0)[0] for _ in range(3))
    seconds, cause = took(20.0)
    assert cause
    # 40 usual ones; with PyBaMM's own limits 300.
    assert seconds < 120.0 * usual


@pytest.mark.slow
def test_a_cell_that_a_leak_empties_in_a_rest_is_empty():
    (leak,) = (effect for effect in EFFECTS if effect.key == "self-discharge")
    clock = np.concatenate([np.arange(0.0, 601.0, 10.0), np.arange(700.0, 20001.0, 100.0)])
    loaded = int(np.count_nonzero(clock <= 600.0))
    steps = (Step(StepKind.CC_DISCHARGE, 0, loaded), Step(StepKind.REST, loaded, len(clock), position=1))
    record = Trajectory(clock, np.where(clock <= 600.0, 1.0, 0.0), np.full(len(clock), 3.2), None, steps)
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (leak,), record, {}, 298.15)
    response = cell.follow({leak.full_name(leak.strength): 0.3}, clock, 0.06)
    assert [pause.empty for pause in response.pauses] == [True]
    assert response.voltage[-1] < 2.1
