"""A time without a unit, and the rate that seconds would make of it."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions, Signal


def discharge(unit_s: float, *without_unit: Signal, last_v: float = 2.8) -> Samples:
    """Rest, a discharge of two hours and a rest, with a clock that counts in a unit of so many seconds."""
    time = 60.0 * np.arange(180) / unit_s
    voltage = np.concatenate([np.full(30, 4.1), np.linspace(4.0, last_v, 120), np.full(30, last_v + 0.3)])
    return Samples("a.csv", time, voltage, np.repeat([0.0, -2.5, 0.0], [30, 120, 30]), without_unit=without_unit)


def test_minutes_without_a_unit_are_asked_for() -> None:
    message = r'column "time" has no unit; .* from 3\.99 V \(row 32\) to 2\.8 V \(row 150\) in 118 s, .* about 31C'
    with pytest.raises(BsaError, match=message) as raised:
        to_record(discharge(60.0, "time"), ReadOptions())
    assert "--unit time=min" in raised.value.hint


@pytest.mark.parametrize(
    "read",
    [
        pytest.param(discharge(60.0), id="a unit was given"),
        pytest.param(discharge(60.0, "voltage"), id="the time has one"),
        pytest.param(discharge(1.0, "time"), id="in seconds it is C/2"),
        pytest.param(discharge(60.0, "time", last_v=3.5), id="no whole discharge"),
    ],
)
def test_a_time_that_can_be_in_seconds_is_none_to_ask_about(read: Samples) -> None:
    assert len(to_record(read, ReadOptions()).trajectory) == 180


@pytest.mark.parametrize(("hours", "asked"), [(10.0, True), (40.0, False)])
def test_a_slow_test_in_minutes_without_a_unit_is_noted(hours: float, asked: bool) -> None:
    record = to_record(discharge(2.0 / hours * 60.0, "time"), ReadOptions())
    found = [note for note in record.notes if "has no unit" in note]
    assert len(found) == asked
    if asked:
        assert ", a rate of about 6.1C. Is it in min, a rate of about C/10? Then say --unit time=min" in found[0]


def test_milliseconds_without_a_unit_are_asked_for() -> None:
    message = r"from 3\.99 V \(row 32\) to 2\.8 V \(row 150\) in 81\.9 days, a rate of about C/1967"
    with pytest.raises(BsaError, match=message) as raised:
        to_record(discharge(1e-3, "time"), ReadOptions())
    assert raised.value.hint == "is it in ms? Then say --unit time=ms (or s if that is right)."
    assert len(to_record(discharge(0.02, "time"), ReadOptions()).trajectory) == 180  # C/100
