"""Rows that are out of time order: what is said of them is what a person finds in the file."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions


def samples(order: np.ndarray) -> Samples:
    """A discharge of an hour, one row in 9 s, in this order of its rows."""
    time = 9.0 * order
    return Samples("a.csv", time, 4.1 - 2e-4 * time, np.full(len(time), -2.0))


@pytest.mark.parametrize("join", [False, True])
def test_a_block_of_rows_that_runs_back_is_no_other_test(join):
    rows = np.arange(400)
    turned = np.concatenate([rows[:100], rows[100:160][::-1], rows[160:]])
    with pytest.raises(BsaError) as found:
        to_record(samples(turned), ReadOptions(join=join))
    assert "the time runs back in 59 of 400 rows, first in row 102 (1431 s, then 1422 s)" in found.value.message
    assert "sort the rows by time" in found.value.hint


@pytest.mark.parametrize("join", [False, True])
def test_rows_in_any_order_are_no_tests_one_behind_the_other(join: bool) -> None:
    with pytest.raises(BsaError, match=r"the time runs back in \d+ of 400 rows, .* not in the order of time") as found:
        to_record(samples(np.random.default_rng(1).permutation(400)), ReadOptions(join=join))
    assert "sort the rows by time (in pandas: .sort_values(" in found.value.hint


def test_a_restart_is_told_by_its_two_rows():
    rows = np.concatenate([np.arange(200), np.arange(100)])
    with pytest.raises(BsaError, match=r"restarts in row 201 \(1791 s, then 0 s\)") as found:
        to_record(samples(rows), ReadOptions())
    assert "--join" in found.value.hint
    assert to_record(samples(rows), ReadOptions(join=True)).trajectory.duration > 2600.0


def test_a_time_that_falls_throughout_is_said_to_fall():
    with pytest.raises(BsaError, match=r"never rises \(it falls from 3591 to 0 s\)") as found:
        to_record(samples(np.arange(400)[::-1]), ReadOptions())
    assert "sort the rows by time" in found.value.hint


def test_a_test_that_was_stopped_within_a_minute_is_a_test_of_its_own() -> None:
    short, long = np.arange(0.0, 50.0), np.arange(0.0, 10_000.0)
    time = np.concatenate([short, long])
    current = np.concatenate([np.full(50, -2.0), np.full(10_000, -1.0)])
    voltage = np.concatenate([np.full(50, 4.05), 4.1 - 0.8 * long / 1e4])
    samples = Samples("p.csv", time, voltage, current)
    with pytest.raises(BsaError, match=r"the clock restarts in row 51 \(49 s, then 0 s\)"):
        to_record(samples, ReadOptions())
    joined = to_record(samples, ReadOptions(join=True)).trajectory
    assert len(joined) == len(time)
    assert joined.discharge_capacity[-1] == pytest.approx((2 * 49.5 + 9999.5) / 3600.0, rel=1e-3)


@pytest.mark.parametrize("place", [7, 9])
def test_a_row_out_of_order_at_the_clocks_beginning_is_no_restart(place: int) -> None:
    time = 10.0 * np.arange(200)
    time[place] = 0.0
    samples = Samples("p.csv", time, np.linspace(4.1, 3.5, 200), np.full(200, -1.0))
    assert len(to_record(samples, ReadOptions()).trajectory) == 199
