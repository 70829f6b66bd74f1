import numpy as np
import pytest
from bsa.core.ageing.cycle_table import CycleTable
from bsa.core.errors import BsaError

NAN = np.full(3, np.nan)


def test_between_cycles_a_column_is_a_straight_line_and_outside_it_is_not_known() -> None:
    table = CycleTable([1, 3, 5], [1.0, 0.9, 0.7], [np.nan, 0.02, 0.04], NAN)
    np.testing.assert_allclose(table.at(np.array([2.0, 4.0])), [0.95, 0.8])
    np.testing.assert_allclose(table.at(np.array([4.0]), "resistance_ohm"), [0.03])
    assert np.all(np.isnan(table.at(np.array([0.0, 6.0]))))
    assert np.all(np.isnan(table.at(np.array([3.0]), "rested_voltage_v")))


def test_the_first_cycles_of_a_table() -> None:
    table = CycleTable([1, 3, 5], [1.0, 0.9, 0.7], NAN, NAN).up_to(4)
    assert list(table.cycle) == [1, 3]
    assert len(table) == 2
    assert CycleTable([2, 3, 5], [1.0, 0.9, 0.7], NAN, NAN).up_to(1) is None


@pytest.mark.parametrize(
    ("cycles", "capacity", "says"),
    [
        ([1, 3, 3], [1, 1, 1], "must rise"),
        ([1, 2, 3], [1, np.nan, 1], "without a capacity"),
        ([1, 2, 3], [1, 1], "has shape"),
        ([], [], "must rise"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused(cycles: list[int], capacity: list[float], says: str) -> None:
    columns = np.full(len(cycles), np.nan)
    with pytest.raises(BsaError, match=says):
        CycleTable(cycles, capacity, columns, columns)
