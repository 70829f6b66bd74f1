"""Words and JSON of `bsa data` have the sign of cyclers."""

from __future__ import annotations

import numpy as np
from bsa.core.reading.summary import summary
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.data.signs import positive_on_charge


def test_currents_and_charges_are_turned_and_resistances_are_not():
    current = np.repeat([0.0, 5.0, 0.0, -2.0], 60)
    time = 10.0 * np.arange(len(current))
    found = summary(Record("a", segment(Trajectory(time, current, 4.0 - 0.05 * current))))
    turned = positive_on_charge(found)
    assert turned.current == (-5.0, 2.0)
    assert [row.current_a for row in turned.steps] == [0.0, -5.0, 0.0, 2.0]
    assert [np.sign(row.charge_ah) for row in turned.steps[1::2]] == [-1.0, 1.0]
    assert [row.current_change_a for row in turned.resistances] == [-5.0, 5.0]
    assert [row.ohm for row in turned.resistances] == [row.ohm for row in found.resistances]
