from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.choice import kept_cycles
from bsa.core.ageing.long_record import long_record, measured_table
from bsa.core.ageing.summary import resistance_delay_s
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


def late(cycle: Trajectory, seconds: float) -> Trajectory:
    """The record of a cycler whose first sample of a step comes so late."""
    first = np.array([step.start for step in cycle.steps[1:]])
    time = cycle.time.copy()
    time[first] += seconds
    return Trajectory(time, steps=cycle.steps, signals=cycle.signals)


def test_a_record_tells_how_long_after_the_switch_its_resistances_are_read(record: Record) -> None:
    whole = record(fade=1e-3, rise=1e-4, count=5, kept=(1, 2, 3, 4, 5))
    assert resistance_delay_s(long_record(whole)) == 0.0
    assert resistance_delay_s(long_record(late(whole, 0.5))) == pytest.approx(0.5)
    # Later ones tell no resistance.
    assert resistance_delay_s(long_record(late(whole, 1.2))) == 0.0


def test_a_late_sample_costs_no_charge_and_tells_no_resistance(record: Record) -> None:
    whole = record(fade=1e-3, rise=1e-4, count=5, kept=(1, 2, 3, 4, 5))
    exact, seen = measured_table(whole, whole.cycles), measured_table(late(whole, 1.2), whole.cycles)
    np.testing.assert_allclose(seen.capacity_ah, exact.capacity_ah, rtol=1e-9)
    assert np.all(np.isfinite(exact.resistance_ohm))
    assert np.all(np.isnan(seen.resistance_ohm))
    assert np.all(np.isfinite(measured_table(late(whole, 0.5), whole.cycles).resistance_ohm))
