"""When a current was switched between two samples is told by the cycler's own counter of charge."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.checks import to_record
from bsa.core.reading.counters import counted_between, with_switches_counted
from bsa.core.reading.joining import joined
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from hypothesis import given
from hypothesis import strategies as st

MARCH = 1_268_000_000.0


def discharge_then_rest(end_s: float, rest_every_s: float = 300.0, sign: float = 1.0) -> Samples:
    """1 A drawn until ``end_s``, sampled each 10 s; the rest behind it every five minutes. Counted as it passed."""
    time = np.concatenate([np.arange(0.0, end_s + 1e-9, 10.0), 1800.0 + rest_every_s * np.arange(8)])
    current = np.where(time <= end_s, 1.0, 0.0)
    counted = np.minimum(time, end_s) / 3600.0
    return Samples("a", time, 4.0 - counted, current, extra={"net_ah": sign * counted})


def drawn_ah(samples: Samples) -> float:
    return float(np.trapezoid(samples.current, samples.time) / 3600.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_discharge_that_ended_at_its_last_sample_does_not_go_on_into_the_rest(sign):
    late = discharge_then_rest(1500.0, sign=sign)
    assert drawn_ah(late) == pytest.approx((1500.0 + 150.0) / 3600.0)
    mended = with_switches_counted(late)
    assert drawn_ah(mended) == pytest.approx(1500.0 / 3600.0)
    assert len(mended) == len(late) + 1  # the switch is at a sample: the rest's first values stand there too
    assert "places: 1; the widest, 300 s, after row 151" in mended.notes[-1]
    assert "-0.0417 A.h drawn" in mended.notes[-1]


@given(st.floats(0.0, 299.0))
def test_the_charge_is_that_of_the_counter_wherever_the_switch_was(later_s):
    late = discharge_then_rest(1500.0)
    end_s = 1500.0 + later_s
    late.extra["net_ah"][late.time > 1500.0] = end_s / 3600.0
    mended = with_switches_counted(late)
    assert drawn_ah(mended) == pytest.approx(end_s / 3600.0, abs=5e-4 * 0.5)
    assert np.all(np.diff(mended.time) >= 0.0)
    # What was added agrees with the counter as well, so that nothing is left to mend or to note.
    again = with_switches_counted(mended)
    assert len(again) == len(mended)


def test_charge_that_no_single_switch_explains_is_left_as_it_is():
    late = discharge_then_rest(1500.0)
    late.extra["net_ah"][late.time > 1500.0] += 0.5
    assert with_switches_counted(late) is late


def test_a_long_silence_is_left_as_it_is():
    late = discharge_then_rest(1500.0)
    later = np.where(late.time > 1500.0, late.time + 3600.0, late.time)
    silent = Samples("a", later, late.voltage, late.current, extra=late.extra)
    assert with_switches_counted(silent) is silent


def test_counters_that_rise_and_start_again_are_taken_on():
    samples = Samples(
        "a",
        np.arange(5.0) * 60.0,
        np.full(5, 3.7),
        np.array([1.0, 1.0, -1.0, -1.0, 1.0]),
        extra={
            "charged_ah": np.array([0.0, 0.0, 0.1, 0.2, 0.0]),
            "discharged_ah": np.array([0.1, 0.2, 0.2, 0.2, 0.05]),
        },
    )
    passed = counted_between(samples)
    assert passed is not None
    np.testing.assert_allclose(passed, [0.1, -0.1, -0.1, 0.05])
    assert counted_between(Samples("a", samples.time, samples.voltage, samples.current)) is None


def test_files_that_alternate_keep_the_counter_that_runs_through_them():
    """As pulse tests are exported: pulses in one file, the discharges between them in the other."""
    whole = discharge_then_rest(1500.0)
    whole.extra["date"] = MARCH + whole.time
    odd = np.arange(len(whole)) // 20 % 2 == 1
    record = to_record(
        joined([whole.kept(odd), whole.kept(~odd)], "cell"), ReadOptions(current_sign="discharge-positive")
    )
    assert record.trajectory.discharge_capacity[-1] == pytest.approx(1500.0 / 3600.0, abs=1e-9)


def test_what_was_added_is_marked_and_stays_marked_in_the_record():
    late = discharge_then_rest(1500.0)
    late.extra["net_ah"][late.time > 1500.0] = 1600.0 / 3600.0
    mended = with_switches_counted(late)
    assert list(np.flatnonzero(mended.inserted)) == [151, 152]
    assert mended.time[mended.inserted] == pytest.approx([1600.0, 1600.0], abs=1.0)
    record = to_record(late, ReadOptions(current_sign="discharge-positive")).trajectory
    assert np.count_nonzero(record.inserted) == 2
    discharge, rest = record.steps
    assert record.inserted[discharge.stop - 1]
    assert record.inserted[rest.start]
    assert record.measured_across(rest) == (150, 153)


@pytest.mark.parametrize("rounding_ah", [-1e-12, 0.0, 1e-12])
def test_a_switch_at_a_sample_needs_one_sample_more_however_a_counter_is_rounded(rounding_ah):
    at_once = discharge_then_rest(1500.0)
    at_once.extra["net_ah"][at_once.time > 1500.0] = 1500.0 / 3600.0 + rounding_ah
    mended = with_switches_counted(at_once)
    assert np.count_nonzero(mended.inserted) == 1
    assert mended.current[mended.inserted] == [0.0]


def test_an_empty_cell_of_a_counter_tells_of_no_switch() -> None:
    late = discharge_then_rest(1500.0)
    place = int(np.flatnonzero(late.time > 1500.0)[0])
    late.extra["net_ah"][place] = np.nan
    assert np.isnan(counted_between(late)[[place - 1, place]]).all()
    assert len(with_switches_counted(late)) == len(late)
