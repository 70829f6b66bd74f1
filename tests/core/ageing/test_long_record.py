from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.choice import kept_cycles
from bsa.core.ageing.long_record import long_record
from bsa.core.errors import BsaError
from bsa.core.trajectory import Trajectory

Record = Callable[..., Trajectory]


def test_a_whole_life_becomes_a_table_and_a_few_curves(record: Record) -> None:
    whole = record(fade=1e-3, count=30, kept=tuple(range(1, 31)))
    short = long_record(whole)
    assert short.cycles == kept_cycles(30, whole.cycle_table)
    assert short.cycle_table is not None
    np.testing.assert_allclose(short.cycle_table.capacity_ah, 1.0 - 1e-3 * np.arange(30))
    np.testing.assert_allclose(short.cycle(30).voltage, whole.cycle(30).voltage)


def test_the_wanted_curves_are_kept(record: Record) -> None:
    whole = record(fade=1e-3, count=30, kept=tuple(range(1, 31)))
    assert long_record(whole, (20, 1)).cycles == (1, 20)
    with pytest.raises(BsaError, match="no cycle 31"):
        long_record(whole, (1, 31))
