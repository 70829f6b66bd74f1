"""An answer does not depend on what was solved before."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bsa.core.task import CellModel
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

(MARCUS,) = (effect for effect in EFFECTS if effect.key == "kinetics-marcus")


@pytest.mark.slow
def test_a_cell_that_ran_empty_leaves_no_trace_in_later_solves(rest_then_discharge):
    time = np.arange(0.0, 4000.0, 20.0)
    record = rest_then_discharge(time, 60.0, 5.0)
    # Marcus kinetics make the overpotentials algebraic.
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (MARCUS,), record, {}, Start(temperature_k=298.15))
    (strength,) = (MARCUS.full_name(parameter) for parameter in MARCUS.parameters)
    before = cell.solve({strength: 0.5}, time, record.current, soc=0.95)
    cell.solve({strength: 3.0}, time, record.current, soc=0.05)
    after = cell.solve({strength: 0.5}, time, record.current, soc=0.95)
    np.testing.assert_array_equal(before.voltage, after.voltage)


def test_integrators_of_two_threads_are_set_up_side_by_side(rest_then_discharge):
    time = np.arange(0.0, 1200.0, 60.0)
    record = rest_then_discharge(time, 60.0, 5.0)

    def solved(name):
        cell = DrivenCell(CellModel(name, "SPM"), (), record, {}, Start(temperature_k=298.15))
        return cell.solve({}, time, record.current, soc=0.9).voltage

    names = ["Chen2020", "Marquis2019"] * 3
    alone = {name: solved(name) for name in set(names)}
    with ThreadPoolExecutor(2) as threads:
        for name, voltage in zip(names, threads.map(solved, names), strict=True):
            np.testing.assert_array_equal(voltage, alone[name])
