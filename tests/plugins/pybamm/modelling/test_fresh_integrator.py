"""An answer does not depend on what was solved before."""

import numpy as np
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

(MARCUS,) = (effect for effect in EFFECTS if effect.key == "kinetics-marcus")


def test_a_cell_that_ran_empty_leaves_no_trace_in_later_solves():
    time = np.arange(0.0, 4000.0, 20.0)
    current = np.where(time < 60.0, 0.0, 5.0)
    steps = (Step(StepKind.REST, 0, 3), Step(StepKind.CC_DISCHARGE, 3, len(time)))
    record = Trajectory(time, current, np.full(len(time), 3.8), None, steps)
    # Marcus kinetics make the overpotentials algebraic.
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (MARCUS,), record, {}, 298.15)
    (strength,) = (MARCUS.full_name(parameter) for parameter in MARCUS.parameters)
    before = cell.solve({strength: 0.5}, time, current, soc=0.95)
    cell.solve({strength: 3.0}, time, current, soc=0.05)
    after = cell.solve({strength: 0.5}, time, current, soc=0.95)
    np.testing.assert_array_equal(before.voltage, after.voltage)
