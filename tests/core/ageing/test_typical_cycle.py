"""The cycle that a life repeats, read off its record."""

from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.cycle_table import CycleTable
from bsa.core.ageing.typical_cycle import typical_cycle, without_cut_short
from bsa.core.errors import BsaError
from bsa.core.trajectory import Step, StepKind, Trajectory

Record = Callable[..., Trajectory]


def test_the_most_frequent_cycle_is_told_in_medians(record: Record) -> None:
    whole = record(fade=1e-3, count=30, kept=tuple(range(1, 31)))
    cycle = typical_cycle(whole, "life")
    assert cycle.steps == ("Charge at 1 A until 4.220 V", "Rest for 60 seconds", "Discharge at 1 A until 3.180 V")
    assert cycle.numbers == tuple(range(1, 31))


def test_cycles_of_other_steps_are_told_apart(record: Record) -> None:
    whole = record(fade=1e-3, count=10, kept=tuple(range(1, 11)))
    # Cycle 4 lost its discharge: its step counts as a rest.
    steps = tuple(
        Step(StepKind.REST, s.start, s.stop, s.cycle, s.label, s.position)
        if s.cycle == 4 and s.kind is StepKind.CC_DISCHARGE
        else s
        for s in whole.steps
    )
    odd = Trajectory(whole.time, steps=steps, signals=whole.signals)
    assert typical_cycle(odd, "life").numbers == (1, 2, 3, 5, 6, 7, 8, 9, 10)


def test_a_drive_cycle_is_refused(record: Record) -> None:
    whole = record(fade=0.0, count=3, kept=(1, 2, 3))
    steps = tuple(Step("drive", s.start, s.stop, s.cycle, s.label, s.position) for s in whole.steps)
    with pytest.raises(BsaError, match="which no protocol tells"):
        typical_cycle(Trajectory(whole.time, steps=steps, signals=whole.signals), "life")


def test_cycles_cut_short_leave_the_table_and_a_fast_fade_does_not() -> None:
    cycle = np.arange(1.0, 61.0)
    capacity = 1.0 - 0.004 * cycle
    capacity[[9, 30]] *= 0.9
    nothing = np.full(60, np.nan)
    kept = without_cut_short(CycleTable(cycle, capacity, nothing, nothing))
    assert set(cycle) - set(kept.cycle) == {10.0, 31.0}


@pytest.mark.parametrize("count", [5, 60])
@pytest.mark.parametrize("short", [[0], [1], [-1], [-2]])
def test_a_cycle_cut_short_leaves_the_table_wherever_it_stands(count: int, short: list[int]) -> None:
    kept = without_cut_short(_faded(count, short))
    assert len(kept) == count - 1
    assert np.all(kept.capacity_ah > 0.7)


@pytest.mark.parametrize("short", [[0, 1], [-1, -2]])
def test_two_cycles_cut_short_at_an_end_leave_the_table(short: list[int]) -> None:
    assert len(without_cut_short(_faded(60, short))) == 58


@pytest.mark.parametrize("count", [1, 2, 3, 60])
def test_whole_cycles_stay(count: int) -> None:
    assert len(without_cut_short(_faded(count, []))) == count


def _faded(count: int, short: list[int]) -> CycleTable:
    """1 % of what is left is lost in each of the last cycles; ``short`` ended at half of their capacity."""
    cycle = np.arange(1.0, count + 1)
    capacity = 0.99 ** np.maximum(cycle - count + 12, 0.0)
    capacity[short] *= 0.5
    nothing = np.full(count, np.nan)
    return CycleTable(cycle, capacity, nothing, nothing)
