from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.summary import filled, in_sequence, line_of, table_of
from bsa.core.trajectory import StepKind, Trajectory

Record = Callable[..., Trajectory]


def test_a_line_tells_capacity_resistance_and_rested_voltage(record: Record) -> None:
    table = record(fade=1e-3, rise=1e-4).cycle_table
    assert table is not None
    np.testing.assert_allclose(table.capacity_ah, 1.0 - 1e-3 * np.arange(50))
    np.testing.assert_allclose(table.resistance_ohm, 0.02 + 1e-4 * np.arange(50))
    np.testing.assert_allclose(table.rested_voltage_v, 4.2)


def test_a_cycle_keeps_its_number_and_its_own_curves_in_a_sequence(record: Record) -> None:
    whole = record(fade=1e-3, kept=(1, 7, 50))
    assert whole.cycles == (1, 7, 50)
    again = in_sequence([(number, whole.cycle(number)) for number in whole.cycles])
    np.testing.assert_allclose(again.time, whole.time)
    assert again.steps == whole.steps
    assert whole.cycle(7).cycle_table is None
    assert whole.thinned(5).cycle_table is whole.cycle_table


def test_without_a_rest_before_it_a_discharge_tells_no_resistance(record: Record) -> None:
    cycle = record(fade=0.0, kept=(1,)).cycle(1)
    [alone] = [piece for step, piece in cycle.pieces() if step.kind is StepKind.CC_DISCHARGE]
    _, capacity, resistance, voltage, *_ = line_of(1, alone)
    assert capacity == pytest.approx(1.0)
    assert np.isnan(resistance)
    assert np.isnan(voltage)


def test_cycles_without_a_discharge_have_no_line(record: Record) -> None:
    cycle = record(fade=0.0, kept=(1,)).cycle(1)
    [charge] = [piece for step, piece in cycle.pieces() if step.kind is StepKind.CC_CHARGE]
    assert table_of([line_of(1, charge)]) is None


def test_gaps_of_a_smooth_fade_are_filled_to_a_hundredth_of_a_percent() -> None:
    cycles = np.array([1, 2, 3, 4, 9, 10, 20, 21, 40, 41, 69, 70, 99, 100.0])
    nothing = np.full(len(cycles), np.nan)
    table = table_of(list(zip(cycles, 1.0 - 0.01 * np.sqrt(cycles), nothing, nothing, strict=True)))
    assert table is not None
    whole = filled(table)
    assert list(whole.cycle) == list(range(1, 101))
    np.testing.assert_allclose(whole.capacity_ah, 1.0 - 0.01 * np.sqrt(whole.cycle), atol=1e-4)
    assert np.all(np.isnan(whole.resistance_ohm))
