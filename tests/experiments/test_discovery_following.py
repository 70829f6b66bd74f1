"""Records of the hidden cell and the driver that follows them share no solver code: at the truth they agree."""

import numpy as np
from bsa.core.segmentation import segment
from bsa.core.task import CellModel
from bsa.experiments.discovery_bench.hidden_cell import Hidden, Leg, measure
from bsa.plugins.pybamm.driven_cell import DrivenCell


def test_six_cycles_sampled_once_a_minute_do_not_drift():
    cell = CellModel("Mohtat2020", "SPMe")
    cycle = [
        Leg(1.0, 4500.0, until_v=3.0, period=60.0),
        Leg(0.0, 300.0, period=60.0),
        Leg(-1.0, 4500.0, until_v=4.2, period=60.0),
        Leg(None, 2400.0, until_rate=0.05, period=60.0, hold_v=4.2),
        Leg(0.0, 300.0, period=60.0),
    ]
    rest = Leg(0.0, 300.0, period=60.0)
    record = segment(measure(cell, Hidden(noise_v=0.0), [rest, *cycle * 6], 0.9, 298.15, np.random.default_rng(0)))
    curve = DrivenCell(cell, (), record, {}, 298.15).solve({}, record.time, record.current, 0.9)
    assert curve is not None
    error = np.abs(curve.voltage - record.voltage)
    last = record.time > record.time[-1] * 5 / 6
    assert np.median(error[last]) < 1.5e-3
