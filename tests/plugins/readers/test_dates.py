"""Dates of several instruments come out in seconds since 1970; what is no date is none."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.plugins.readers.dates import clock_s, elapsed_s, exchanged, seconds_of


@pytest.mark.parametrize(
    "text",
    [
        "2010-08-17 13:44:57",
        "2010-08-17T13:44:57",
        "8/17/2010 1:44:57 PM",
        "17/08/2010 13:44:57",
        "17.8.2010 13:44:57",
        "17-Aug-2010 13:44:57",
        "17 August 2010 13:44:57",
        "1282052697.0",
    ],
)
def test_one_moment_in_many_spellings(text):
    found = seconds_of([text, "", text])
    assert found[0] == found[2] == 1282052697.0
    assert np.isnan(found[1])


def test_fractions_of_seconds_may_be_missing_in_some_cells():
    np.testing.assert_allclose(seconds_of(["2010-08-17 00:00:00", "2010-08-17 00:00:29.5"]) % 86400, [0.0, 29.5])


@pytest.mark.parametrize(
    "texts", [[], [""], ["PAU", "CHA"], ["1", "2"], ["00:10:00"], ["17-Abc-2010"], ["1e300"], ["9999-99-99"]]
)
def test_what_is_no_date(texts):
    assert seconds_of(texts) is None


def test_between_points_the_day_comes_first():
    assert seconds_of(["1.3.2024 00:00:00"])[0] == seconds_of(["2024-03-01"])[0]
    assert seconds_of(["1/3/2024 00:00:00"])[0] == seconds_of(["2024-01-03"])[0]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("00:00:00.115", 0.115),
        ("26:10:00", 94200.0),
        ("1d 02:10:00,5", 94200.5),
        ("1 day, 2:10:00", 94200.0),
        ("1-02:10:00", 94200.0),
        ("0d 00:00:5.05000019073486", 5.05),
    ],
)
def test_clocks(text, seconds):
    assert clock_s(text) == pytest.approx(seconds)


@pytest.mark.parametrize("text", ["", "12", "10:00", "2024-03-01 10:00:00", "PAU"])
def test_what_is_no_clock(text):
    assert clock_s(text) is None


def test_time_passes_between_dates_and_between_clocks():
    time, date = elapsed_s(["2024-02-29T23:59:50", "", "2024-03-01T00:00:10.5"], "a", "Date")
    assert [time[0], time[2], date[2] - date[0]] == [0.0, 20.5, 20.5]
    assert np.isnan(time[1])
    time, date = elapsed_s(["00:00:01", "100:00:01"], "a", "Time")
    assert [*time, date] == [1.0, 360001.0, None]


def test_clocks_that_fall_where_the_day_changes_are_times_of_the_day():
    days = seconds_of(["2024-02-29", "2024-02-29", "2024-03-01"])
    time, date = elapsed_s(["23:59:40", "23:59:50", "00:00:00"], "a", "Time", days)
    assert list(time) == [0.0, 10.0, 20.0]
    assert date[2] == days[2]
    time, date = elapsed_s(["00:00:40", "00:00:50", "00:01:00"], "a", "Time", days)
    assert [*time, date] == [40.0, 50.0, 60.0, None]
    once = seconds_of(["2024-02-29", "", ""])  # as a person writes it
    time, date = elapsed_s(["10:00:00", "10:00:10", "10:00:20"], "a", "Time", once)
    assert [*np.diff(time), date] == [10.0, 10.0, None]


def test_a_day_that_could_be_the_month_is_refused_where_it_matters():
    time, _ = elapsed_s(["1/3/2024 10:00:00", "1/3/2024 10:00:05"], "a", "Date")
    assert list(time) == [0.0, 5.0]
    with pytest.raises(BsaError, match=r'column "Date" does not tell the month from the day \("1/3/2024 23:59:59"\)'):
        elapsed_s(["1/3/2024 23:59:59", "2/3/2024 00:00:04"], "a", "Date")
    with pytest.raises(BsaError, match="holds no times that are understood"):
        elapsed_s(["1:2/3-4/5 o'clock"], "a", "Date")


@pytest.mark.parametrize(
    ("texts", "day_first"),
    [
        (["13/04/2024 10:00:00", "14/04/2024"], True),
        (["04/12/2024", "04/13/2024"], False),
        (["03/04/2024 10:00"], None),
        (["1.3.2024"], None),
        (["2024-03-04"], None),
        (["2024/03/04"], None),
        (["", "12.5"], None),
        (["03-Apr-2024"], None),
    ],
)
def test_whether_the_day_comes_first_may_be_told_by_one_date(texts, day_first):
    told, other = exchanged(texts)
    assert told is day_first
    assert (other is not None) == (texts == ["03/04/2024 10:00"])
    if other is not None:
        assert other[0] == seconds_of(["2024-04-03 10:00:00"])[0]
        assert seconds_of(texts)[0] == seconds_of(["2024-03-04 10:00:00"])[0]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("05.03.2024 22:00:00", "06.03.2024 01:00:00"),
        ("2024/3/5 22:00:00", "2024/3/6 01:00:00"),
        ("2024-3-5 22:00:00", "2024-3-6 01:00:00"),
    ],
)
def test_dates_that_say_their_order_may_cross_midnight(first, second):
    since, _ = elapsed_s([first, second], "a.csv", "Date")
    assert since.tolist() == [0.0, 10800.0]


@pytest.mark.parametrize(
    ("header", "first", "later"),
    [
        ("Date Time", ",", "2024-03-01 10:{0:02d}:00,"),
        ("Date,Time", "2024-03-01,,", "2024-03-01,10:{0:02d}:00,"),
        ("Date,Time", ",10:00:00,", "2024-03-01,10:{0:02d}:00,"),
        ("Time", "n/a,", "0:{0:02d}:00,"),
        ("Unix Time", ",", "17000{0:02d}000,"),
    ],
)
def test_a_first_row_without_a_date_or_a_clock_is_left_out_like_any_other(tmp_path, header, first, later):
    written = [first, *(later.format(k) for k in range(1, 40))]
    rows = [f"{when}{4.1 - 0.01 * k},-1.0" for k, when in enumerate(written)]
    (tmp_path / "a.csv").write_text("\n".join([f"{header},Voltage [V],Current [A]", *rows]))
    record = read_record(tmp_path / "a.csv")
    assert len(record.trajectory) == 39
    assert np.ptp(np.diff(record.trajectory.time)) == 0.0
    assert any("1 sample without a value was left out (row 2)" in note for note in record.notes)


def test_a_few_dates_above_the_twelfth_tell_the_order_for_all():
    """So few had been taken for cells that hold no date, and the others for dates of nine months."""
    days = [f"{3 + k // 144:02d}/04/2024 {k // 6 % 24:02d}:{10 * (k % 6):02d}:00" for k in range(10 * 144 + 5)]
    since, dates = elapsed_s(days, "a", "Date")
    np.testing.assert_allclose(np.diff(since), 600.0)
    assert dates[0] == seconds_of(["2024-04-03"])[0]
