import numpy as np
import pytest
from bsa.core.ageing.choice import KEPT, SHOWN, kept_cycles, knee, levelling, shown_cycles
from bsa.core.ageing.cycle_table import CycleTable


def table(capacity: np.ndarray) -> CycleTable:
    nothing = np.full(len(capacity), np.nan)
    return CycleTable(np.arange(1.0, len(capacity) + 1), capacity, nothing, nothing)


CYCLES = np.arange(1.0, 501.0)
STRAIGHT = table(1.0 - 4e-4 * CYCLES)
WITH_KNEE = table(1.0 - 1e-4 * CYCLES - 2e-3 * np.maximum(CYCLES - 350, 0))
LEVELLING = table(1.0 - 0.01 * np.sqrt(CYCLES))


def test_bends_of_a_fade_are_where_they_were_put() -> None:
    assert knee(STRAIGHT) is None
    assert levelling(STRAIGHT) is None
    assert knee(WITH_KNEE) == pytest.approx(350, abs=3)
    assert levelling(WITH_KNEE) is None
    assert knee(LEVELLING) is None
    assert levelling(LEVELLING) == pytest.approx(125, abs=20)


def test_a_first_cycle_that_starts_from_elsewhere_is_no_bend() -> None:
    capacity = STRAIGHT.capacity_ah.copy()
    capacity[0] += 0.03
    assert levelling(table(capacity)) is None


def test_one_odd_cycle_is_no_knee() -> None:
    capacity = STRAIGHT.capacity_ah.copy()
    capacity[100] += 0.1
    assert knee(table(capacity)) is None


@pytest.mark.parametrize("count", [1, 2, 20, 200, 2000])
def test_as_many_curves_are_kept_of_any_length_of_record(count: int) -> None:
    kept = kept_cycles(count)
    assert kept[0] == 1
    assert kept[-1] == count
    assert len(kept) <= KEPT
    assert len(kept) >= min(KEPT, count) - 1


def test_the_knee_is_kept_and_only_cycles_of_the_table() -> None:
    kept = kept_cycles(500, WITH_KNEE)
    assert any(abs(cycle - 350) <= 3 for cycle in kept)
    assert len(kept) <= KEPT
    every_tenth = CycleTable(*(getattr(WITH_KNEE, name)[9::10] for name in WITH_KNEE.__dataclass_fields__))
    assert set(kept_cycles(500, every_tenth)) <= set(every_tenth.cycle)


def test_what_is_shown_is_first_last_knee_worst_and_what_was_asked_for() -> None:
    kept = kept_cycles(500, WITH_KNEE)
    off = np.where(np.abs(CYCLES - kept[3]) < 1, 0.05, 0.0)
    shown = shown_cycles(kept, WITH_KNEE, table(WITH_KNEE.capacity_ah + off), asked=(40,))
    assert shown[1] == "first"
    assert "last" in shown[500]
    assert "knee" in shown[knee(WITH_KNEE) or 0]
    assert "largest capacity mismatch" in shown[kept[3]]
    assert any("asked for (40)" in reason for reason in shown.values())
    assert list(shown) == sorted(shown)


@pytest.mark.parametrize("count", [20, 2000])
def test_no_more_is_shown_of_a_longer_record(count: int) -> None:
    life = table(1.0 - 0.2 * np.arange(count) / count)
    assert len(shown_cycles(kept_cycles(count), life, life, asked=range(1, count))) <= SHOWN


def test_a_recovery_after_a_pause_is_no_knee() -> None:
    cycle = np.arange(1.0, 201.0)
    capacity = 1.1 - 0.007 * np.sqrt(cycle)
    capacity[170:195] += 0.01
    assert knee(table(capacity)) is None
    assert levelling(table(capacity)) is not None
