import numpy as np
import pytest
from bsa.core.segmentation import segment
from bsa.core.task import CellModel
from bsa.core.trajectory import StepKind, Trajectory
from bsa.plugins.effects.electrical import double_layer_capacitance
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell


@pytest.mark.slow
def test_a_double_layer_of_no_capacitance_can_be_simulated_behind_a_drive():
    levels = np.repeat(np.random.default_rng(0).choice([0.0, 0.2, 0.45, 0.8, 1.2, -0.3], 10), 10)
    drive = np.convolve(np.append(levels, [0.0, 0.0]), np.ones(3) / 3, mode="valid")
    time = np.concatenate([np.arange(100.0), 99.0 + np.arange(0.0, 900.0, 14.5)])
    current = np.append(drive, np.zeros(len(time) - len(drive)))
    record = segment(Trajectory(time, current, np.full(len(time), 3.9), None))
    assert [step.kind for step in record.steps] == [StepKind.DRIVE, StepKind.REST]
    effect = double_layer_capacitance
    cell = DrivenCell(CellModel(parameter_set="Marquis2019", model="SPMe"), (effect,), record, {})
    null, probe = (
        cell.solve({effect.full_name(effect.strength): size}, time, current, 0.8)
        for size in (effect.strength.null, effect.strength.probe)
    )
    assert null is not None
    assert probe is not None
    assert np.abs(probe.voltage - null.voltage)[-1] < 1e-4 < np.max(np.abs(probe.voltage - null.voltage))
