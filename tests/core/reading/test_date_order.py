"""Month or day first: one file of a cell tells it for the others, and what nobody tells is not guessed."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.date_order import starts_of, with_one_order
from bsa.core.reading.joining import joined
from bsa.core.reading.reading import read_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions


def named(*names: str) -> list[Samples]:
    return [Samples(name, np.arange(5.0), np.full(5, 4.0), np.zeros(5)) for name in names]


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (["cell7_01_02_24", "cell7_15_01_24"], [1, 0]),  # the 15th tells that the day comes first
        (["cell7_01_15_24", "cell7_02_01_24"], [0, 1]),
        (["CS2_35_10_1_10", "CS2_35_9_7_10", "CS2_35_8_17_10"], [2, 1, 0]),
        (["a 03-04-24", "b 05-06-24"], [0, 1]),  # the same in both orders
        (["a 2024-02-01", "b 2024-01-12"], [1, 0]),
    ],
)
def test_a_name_that_tells_the_order_tells_it_for_all(names, order):
    assert np.argsort(starts_of(named(*names))).tolist() == order


def test_names_that_do_not_tell_the_order_are_refused_where_it_matters():
    with pytest.raises(BsaError, match=r'do not tell the month from the day.*: "a_01_02_24", "a_02_01_24"') as found:
        joined(named("a_01_02_24", "a_02_01_24"), "a")
    assert "2024-03-01" in found.value.hint


@pytest.mark.parametrize("names", [["a", "b_01_02_24"], ["a_25_10_12", "b_10_25_12"]])
def test_names_without_a_date_or_with_none_in_common_have_no_order(names):
    assert np.isnan(starts_of(named(*names))).any()


def written(path, day: str, hour: int = 10):
    rows = (f"{day} {hour + k // 60:02d}:{k % 60:02d}:00,{60 * k},{4.2 - 0.01 * k:.4f},-1" for k in range(70))
    path.write_text("\n".join(["Date_Time,Test Time (s),Voltage (V),Current (A)", *rows]))
    return path


def test_a_file_whose_dates_tell_the_order_tells_it_for_all(tmp_path):
    one, two = written(tmp_path / "one.csv", "12/04/2024"), written(tmp_path / "two.csv", "13/04/2024")
    record = read_record([two, one])
    assert '2 parts were joined by date: "one.csv", "two.csv".' in record.notes
    assert record.trajectory.duration == 86400.0 + 69 * 60.0
    two = written(tmp_path / "two.csv", "04/13/2024")
    one = written(tmp_path / "one.csv", "04/12/2024")
    assert read_record([two, one]).trajectory.duration == 86400.0 + 69 * 60.0


def test_dates_that_do_not_tell_the_order_are_refused_where_it_matters_and_else_noted(tmp_path):
    one, two = written(tmp_path / "one.csv", "01/02/2024"), written(tmp_path / "two.csv", "02/01/2024")
    with pytest.raises(BsaError, match=r'and the order of the files depends on it: "one.csv", "two.csv"'):
        read_record([one, two])
    two = written(tmp_path / "two.csv", "02/02/2024")
    record = read_record([one, two])
    assert "the dates do not tell the month from the day; the month was taken to come first." in record.notes
    assert record.trajectory.duration == 31 * 86400.0 + 69 * 60.0
    same_day = read_record([one, written(tmp_path / "two.csv", "01/02/2024", hour=20)])
    assert not any("month" in note for note in same_day.notes)
    assert same_day.trajectory.duration == 36000.0 + 69 * 60.0
    points = read_record([written(one, "01.02.2024"), written(two, "02.02.2024")])
    assert not any("month" in note for note in points.notes)
    assert points.trajectory.duration == 86400.0 + 69 * 60.0


def test_what_is_told_once_is_not_turned_again():
    dates = np.arange(5.0) + 1.7e9
    told = [
        Samples("a", np.arange(5.0), np.full(5, 4.0), np.zeros(5), extra={"date": dates}, day_first=True),
        Samples("b", np.arange(5.0), np.full(5, 4.0), np.zeros(5), extra={"date": dates, "other_date": dates + 9e6}),
    ]
    whole = joined(told, "c")
    assert whole.extra["date"][5] - whole.extra["date"][0] == 9e6
    assert whole.day_first is True
    again = with_one_order([whole, *named("d")])
    np.testing.assert_array_equal(again[0].extra["date"], whole.extra["date"])


def test_days_without_a_time_order_files_and_are_no_clock(tmp_path):
    def dated(name: str, day: str):
        path = tmp_path / name
        rows = (f"{day},{60 * k},{4.2 - 0.01 * k:.4f},-1" for k in range(60))
        path.write_text("\n".join(["Date,Test Time (s),Voltage (V),Current (A)", *rows]))
        return path

    late, early = dated("a.csv", "2024-03-02"), dated("b.csv", "2024-03-01")
    record = read_record([late, early])
    assert '2 parts were joined by date: "b.csv", "a.csv".' in record.notes
    assert len(record.trajectory) == 120
    assert record.trajectory.duration == 119 * 60.0
    assert any("after one interval, for want of a date" in note for note in record.notes)
    record = read_record([late, dated("c.csv", "2024-03-02")])
    assert any("by date, those of one day in the order given" in note for note in record.notes)
    assert len(record.trajectory) == 120
    assert len(read_record([late, early], ReadOptions(join=True)).trajectory) == 120
