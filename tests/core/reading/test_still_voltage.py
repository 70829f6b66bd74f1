"""A voltage that does not answer the current."""

import numpy as np
import pytest
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions

REST_AND_DISCHARGE = np.repeat([0.0, -2.0, 0.0], 40)
FALLING = -2.0 * np.exp(-np.arange(120) / 40.0)


@pytest.mark.parametrize(
    ("current", "ohm", "said"),
    [
        pytest.param(REST_AND_DISCHARGE, 0.0, True, id="a switched current"),
        pytest.param(REST_AND_DISCHARGE, 0.001, False, id="a cell of 1 mohm"),
        pytest.param(FALLING, 0.0, False, id="a hold at constant voltage"),
        pytest.param(np.zeros(120), 0.0, False, id="a rest"),
    ],
)
def test_a_voltage_that_stands_still_while_the_current_switches_is_noted(
    current: np.ndarray, ohm: float, said: bool
) -> None:
    voltage = 3.7 + ohm * current
    record = to_record(Samples("a.csv", 10.0 * np.arange(120), voltage, current, names={"voltage": "U"}), ReadOptions())
    notes = [note for note in record.notes if 'column "U" stays at 3.700 V while the current switches' in note]
    assert len(notes) == said
