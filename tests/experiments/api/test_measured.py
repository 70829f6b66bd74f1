"""`bsa.read_record`: files and DataFrames become the same records."""

import inspect

import bsa
import numpy as np
import pandas as pd
import pytest
from bsa.core.errors import BsaError
from bsa.experiments.api.measured import READING, read_record
from bsa.experiments.tasks.find import PACKAGED

DEMO = PACKAGED / "demo.csv"


def frame(**changes):
    time = np.arange(0.0, 1000.0, 10.0)
    content = {"time": time, "current": np.where(time < 300, 0.0, -2.0), "voltage": 4.0 - time / 5000, **changes}
    return pd.DataFrame(content)


def test_the_options_of_reading_are_those_that_a_record_is_read_with() -> None:
    assert set(READING) <= set(inspect.signature(read_record).parameters)
    assert {"column", "unit", "temperature", "cycles", "sheet"} <= set(READING)


def test_a_frame_of_a_file_is_the_record_of_the_file() -> None:
    of_file, of_frame = bsa.read_record(DEMO), bsa.read_record(pd.read_csv(DEMO), name="demo")
    for signal in ("current", "voltage"):
        np.testing.assert_array_equal(of_file.trajectory.values(signal), of_frame.trajectory.values(signal))
    assert of_file.trajectory.steps == of_frame.trajectory.steps
    assert of_frame.name == "demo"


def test_current_is_positive_on_charge_unless_it_is_said() -> None:
    assert bsa.read_record(frame()).trajectory.current.max() == 2.0
    other = frame()
    other["current"] = -other["current"]
    assert bsa.read_record(other, current_sign="discharge-positive").trajectory.current.max() == 2.0


def test_columns_and_units_are_said_as_for_a_file() -> None:
    data = frame(temperature=25.0, voltage=np.linspace(4000.0, 3800.0, 100)).rename(
        columns={"voltage": "cell", "time": "Time [min]"}
    )
    record = bsa.read_record(data, column={"voltage": "cell"}, unit={"voltage": "mV"})
    assert record.trajectory.voltage[0] == 4.0
    assert record.trajectory.time[1] == 600.0
    assert record.ambient_k == 298.15


def test_several_files_are_one_record(tmp_path) -> None:
    for name in ("b_2024-05-02.csv", "a_2024-05-01.csv"):
        frame().to_csv(tmp_path / name, index=False)
    record = bsa.read_record(sorted(tmp_path.iterdir(), reverse=True))
    assert len(record.trajectory) == 2 * len(frame())
    assert any("joined by date" in note for note in record.notes)
    assert bsa.read_record(tmp_path / "a_2024-05-01.csv", name="first").name == "first"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (frame().drop(columns="current"), "no column for current"),
        (frame().iloc[:0], "no rows"),
        (frame(voltage=["a"] * 100), r'row 1, column "voltage": "a" is not a number \(100 of 100 rows are so\)'),
        (frame(voltage=pd.date_range("2024", periods=100)), "is not a number"),
        ([1, 2], "list is no record"),
        ({"time": [1]}, "dict is no record"),
    ],
)
def test_what_is_wrong_with_a_frame_is_said_in_a_line(data, words) -> None:
    with pytest.raises(BsaError, match=words):
        bsa.read_record(data)


def test_a_missing_cell_is_repaired_as_in_a_file() -> None:
    data = frame()
    data.loc[5, "voltage"] = np.nan
    record = bsa.read_record(data)
    assert any("6" in note for note in record.notes)


@pytest.mark.parametrize("nothing", [pd.NA, None, "n/a", "-", "  "])
def test_what_says_that_there_is_nothing_is_a_missing_cell(nothing) -> None:
    data = frame().astype(object)
    data.loc[5, "voltage"] = nothing
    record = bsa.read_record(data)
    assert len(record.trajectory) == 99
    assert any("1 sample without a value was left out (row 6)" in note for note in record.notes)


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_a_first_row_without_a_date_is_left_out(zone) -> None:
    dates = pd.date_range("2024-03-01", periods=100, freq="10s", tz=zone)
    record = bsa.read_record(frame(time=[pd.NaT, *dates[1:]]))
    assert len(record.trajectory) == 99
    assert record.trajectory.duration == 980.0


@pytest.mark.parametrize("function", [bsa.calibrate, bsa.discover])
def test_an_empty_list_of_records_is_refused_in_a_line(function) -> None:
    with pytest.raises(BsaError, match="data is empty"):
        function([], parameters="Chen2020")
