"""A record that passes more charge than any cell holds."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions


def discharge(amperes: float) -> Samples:
    """Rest, a discharge of two hours and a rest."""
    voltage = np.concatenate([np.full(30, 4.1), np.linspace(4.0, 2.8, 120), np.full(30, 3.1)])
    current = np.repeat([0.0, -amperes, 0.0], [30, 120, 30])
    return Samples("a.csv", 60.0 * np.arange(180), voltage, current, names={"current": "I / A"})


def test_milliamperes_that_are_taken_for_amperes_are_asked_for() -> None:
    with pytest.raises(BsaError, match=r"3967 A\.h pass in one direction from row 31 to row 150, more than") as raised:
        to_record(discharge(2000.0), ReadOptions())
    assert 'column "I / A", up to 2000 A' in raised.value.message
    assert "--unit current=mA" in raised.value.hint


@pytest.mark.parametrize(("amperes", "units"), [(600.0, {}), (2000.0, {"current": "A"})])
def test_a_large_cell_and_a_unit_that_a_person_says_are_taken(amperes: float, units: dict[str, str]) -> None:
    options = ReadOptions.model_validate({"units": units})
    assert len(to_record(discharge(amperes), options).trajectory) == 180
