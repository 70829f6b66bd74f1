"""Well-formed files of every kind give the record that was put into them."""

from __future__ import annotations

import datetime
import gzip

import numpy as np
import openpyxl
import pandas as pd
import pytest
from bsa.core.contracts.registry import installed
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import Reader, ReadOptions
from bsa.core.segmentation import segment
from bsa.core.trajectory import StepKind, Trajectory
from bsa.plugins.readers.arrays import ArrayTable
from bsa.plugins.readers.assembly import read_table
from bsa.plugins.readers.bdf import write
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays


def discharge(n: int = 200) -> Trajectory:
    """Rest, 1C discharge, rest of a 5 Ah cell, in the package's convention."""
    time = np.arange(n) * 10.0
    current = np.where((time >= 200) & (time < 10 * n - 400), 5.0, 0.0)
    drawn = np.cumsum(current) * 10 / 3600
    return Trajectory(time, current, 4.1 - 0.3 * drawn - 0.03 * current, np.full(n, 298.15) + drawn)


def table(trajectory: Trajectory, header: str, scale=(1.0, 1.0, 1.0), separator: str = ",") -> str:
    lines = [header]
    for t, v, i in zip(trajectory.time, trajectory.voltage, -trajectory.current, strict=True):
        cells = (t * scale[0], v * scale[1], i * scale[2])
        lines.append(separator.join(repr(float(cell)) for cell in cells))
    return "\n".join(lines) + "\n"


def assert_same(found: Trajectory, made: Trajectory) -> None:
    np.testing.assert_allclose(found.time, made.time, atol=1e-4)
    np.testing.assert_allclose(found.voltage, made.voltage, atol=2e-6)
    np.testing.assert_allclose(found.current, made.current, atol=2e-6)
    assert [step.kind for step in found.steps] == [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST]


@pytest.mark.parametrize(
    ("name", "header", "scale", "separator"),
    [
        ("a.csv", "Test Time / s,Voltage / V,Current / A", (1, 1, 1), ","),
        ("a.csv", "Test Time / h,Voltage / mV,Current / mA", (1 / 3600, 1000, 1000), ","),
        ("a.csv", "test_time_second,voltage_volt,current_ampere", (1, 1, 1), ","),
        ("a.csv", "Time [s],U[V],I[A]", (1, 1, 1), ","),
        ("a.csv", "time_s;voltage_V;current_A", (1, 1, 1), ";"),
        ("a.tsv", "Time (min)\tVoltage (V)\tCurrent (mA)", (1 / 60, 1, 1000), "\t"),
        ("a.txt", "t/s U/V I/A", (1, 1, 1), " "),
        ("a.csv", "Some cycler\nSerial number,17\n\nTime [s],U[V],I[A]", (1, 1, 1), ","),
        ("a.csv", "Time,Voltage,Current\n[s],[V],[A]", (1, 1, 1), ","),
        ("a.csv", "Prüfzeit [s];Spannung [V];Strom [mA]", (1, 1, 1000), ";"),
        ("a.csv", "Temps (s),Tension (V),Courant (A)", (1, 1, 1), ","),
        ("a.csv", "测试时间(s),电压(mV),电流（mA）", (1, 1000, 1000), ","),
    ],
)
def test_headers_and_units_are_understood(tmp_path, name, header, scale, separator):
    made = discharge()
    path = tmp_path / name
    path.write_text(table(made, header, scale, separator))
    record = read_record(path)
    assert_same(record.trajectory, made)
    assert record.notes == ()
    assert record.name == name


@pytest.mark.parametrize(
    ("encoding", "title", "header"),
    [
        ("cp1252", "Windows-1252", "Prüfzeit [s],Spannung [V],Strom [A]"),
        ("gb18030", "GB 18030", "测试时间(s),电压(V),电流(A)"),
        ("utf-16", "UTF-16", "测试时间(s),电压(V),电流(A)"),
    ],
)
def test_older_encodings_are_recognised_and_noted(tmp_path, encoding, title, header):
    made = discharge()
    path = tmp_path / "a.csv"
    path.write_bytes(table(made, header).encode(encoding))
    record = read_record(path)
    assert_same(record.trajectory, made)
    assert [note for note in record.notes if title in note]


def test_decimal_commas_are_read_and_noted(tmp_path):
    made = discharge()
    path = tmp_path / "a.csv"
    path.write_text(table(made, "Time [s];U[V];I[A]", separator=";").replace(".", ","))
    record = read_record(path)
    assert_same(record.trajectory, made)
    assert any("decimal commas" in note for note in record.notes)


@pytest.mark.parametrize("separator", [",", ";"])
def test_decimal_commas_in_quotation_marks_are_read_whatever_parts_the_cells(tmp_path, separator):
    path = tmp_path / "a.csv"
    rows = ([f'"{10 * k},5"', f'"4,{190 - k}"', "-2"] for k in range(50))
    path.write_text(separator.join(["Time [s]", "U [V]", "I [A]"]) + "\n" + "\n".join(map(separator.join, rows)))
    record = read_record(path)
    assert record.trajectory.voltage[1] == 4.189
    assert record.trajectory.time[1] == 10.5
    assert any("decimal commas" in note for note in record.notes)


def test_commas_beside_points_part_thousands_and_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time [s],U [V],I [A]\n" + "".join(f'"1,{200 + k}",4.19,-2.5\n' for k in range(50)))
    with pytest.raises(BsaError, match='"1,200" is not a number'):
        read_record(path)


def test_gzip_mapping_and_rows_of_one_test(tmp_path):
    made = discharge()
    rows = table(made, "x").splitlines()[1:]
    text = "test,a,b,c\n" + "".join(f"{k},{row}\n" for k in (1, 2) for row in rows)
    path = tmp_path / "many.csv.gz"
    path.write_bytes(gzip.compress(text.encode()))
    columns = {"time": "a", "voltage": "b", "current": "c"}
    with pytest.raises(BsaError, match=r"the clock restarts in row 202 \(1990 s, then 0 s"):
        read_record(path, ReadOptions(columns=columns))
    record = read_record(path, ReadOptions(columns=columns, where={"test": "2"}))
    assert_same(record.trajectory, made)
    assert [note for note in record.notes if '"a", "b", "c" have no units; they were taken to be in s, V, A' in note]


def test_units_can_be_said(tmp_path):
    made = discharge()
    path = tmp_path / "a.csv"
    path.write_text(table(made, "time,voltage,current", (1 / 60, 1000, 1000)))
    record = read_record(path, ReadOptions(units={"time": "min", "voltage": "mV", "current": "mA"}))
    assert_same(record.trajectory, made)


def test_a_constant_current_can_be_said(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{10 * k}\t{4.1 - 0.01 * k}\r\n" for k in range(100)))
    options = ReadOptions(columns={"time": "1", "voltage": "2"}, constant_current_a=-2.28)
    record = read_record(path, options)
    assert np.all(record.trajectory.current == 2.28)


def test_a_constant_current_beside_a_current_column_is_said_not_to_be_used(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],U [V],I [A]\n" + "".join(f"{k},{4.0 - 0.001 * k},-2.0\n" for k in range(100)))
    record = read_record(path, ReadOptions(constant_current_a=-3.0))
    assert record.trajectory.current[0] == 2.0
    assert any('the current of column "I [A]" was used, not the constant -3 A' in note for note in record.notes)


def test_all_values_that_a_row_could_be_chosen_by_are_counted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],U [V],I [A],test_id\n" + "".join(f"{k},4.0,-2.0,{k}\n" for k in range(168)))
    with pytest.raises(BsaError, match="no row where test_id is 999") as found:
        read_record(path, ReadOptions(where={"test_id": "999"}))
    assert found.value.hint.endswith(" and 160 more.")


@pytest.mark.parametrize("sign", ["discharge-positive", "auto"])
def test_the_sign_can_be_said_or_found(tmp_path, sign):
    made = discharge()
    path = tmp_path / "a.csv"
    path.write_text(table(made, "Time [s],U[V],I[A]", (1, 1, -1)))
    record = read_record(path, ReadOptions(current_sign=sign))
    assert_same(record.trajectory, made)


def test_repairs_are_noted_with_their_rows(tmp_path):
    made = discharge()
    lines = table(made, "Time [s],U[V],I[A]").splitlines()
    lines[50] = lines[50].replace(lines[50].split(",")[1], "8.39")
    lines[60] = lines[60].replace(lines[60].split(",")[1], "")
    lines.insert(71, lines[70])
    lines.insert(101, lines[90])
    lines.append("1999.0,3.")
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    record = read_record(path)
    assert len(record.trajectory) == 198
    notes = " | ".join(record.notes)
    assert "1 voltage glitch was left out (8.39 V in row 51)" in notes
    assert "1 sample without a value was left out (row 61)" in notes
    assert "row 72" in notes
    assert "1 sample out of time order was left out (row 102)" in notes
    assert "row 204, the last one, is incomplete" in notes


def test_a_unit_in_place_of_the_header_s_is_noted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table(discharge(), "Time [s],U[V],I[A]"))
    record = read_record(path, ReadOptions(units={"current": "mA"}))
    assert 'column "I[A]" was read in mA, as said, not in A, as the file has it.' in record.notes


def test_the_two_samples_of_a_switch_may_share_a_stamp(tmp_path):
    made = discharge()
    lines = table(made, "Time [s],U[V],I[A]").splitlines()
    lines.insert(21, lines[21].rsplit(",", 1)[0] + ",0.0")
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    record = read_record(path)
    assert len(record.trajectory) == 201
    assert record.notes == ()


def test_gaps_are_noted(tmp_path):
    made = discharge()
    lines = table(made, "Time [s],U[V],I[A]").splitlines()
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines[:30] + lines[150:]))
    note = read_record(path).notes[0]
    assert "the longest of 1210 s after row 30; current flowed across it," in note


def test_temperatures(tmp_path):
    made = discharge()
    path = tmp_path / "a.csv"
    rows = table(made, "Time [s],U[V],I[A]").splitlines()
    celsius = made.temperature - 273.15
    path.write_text(
        "\n".join([rows[0] + ",Probe [degC]"] + [f"{r},{c}" for r, c in zip(rows[1:], celsius, strict=True)])
    )
    assert read_record(path).trajectory.temperature is None
    record = read_record(path, ReadOptions(columns={"temperature": "Probe [degC]"}))
    np.testing.assert_allclose(record.trajectory.temperature, made.temperature)
    assert record.ambient_k == pytest.approx(298.15)
    assert read_record(path, ReadOptions(ambient_c=10.0)).ambient_k == pytest.approx(283.15)


def cycling(count: int) -> Trajectory:
    current = np.tile(np.concatenate([np.full(100, -2.0), np.zeros(30), np.full(100, 2.0), np.zeros(30)]), count)
    charge = 1.0 - np.cumsum(current) * 30 / 3600
    return Trajectory(np.arange(len(current)) * 30.0, current, 3.0 + 0.3 * charge - 0.03 * current)


def test_cycles_can_be_chosen(tmp_path):
    path = tmp_path / "a.csv"
    write(cycling(4), path)
    chosen = read_record(path, ReadOptions(cycles=(2, 3))).trajectory
    assert chosen.cycles == (2, 3)
    assert len(chosen) == 520
    with pytest.raises(BsaError, match="has cycles 1 to 4, not 2 to 9"):
        read_record(path, ReadOptions(cycles=(2, 9)))


# At 30 mohm less than the half volt that a record of seconds cannot show.
finite = st.floats(-8, 8, allow_subnormal=False)


@pytest.mark.slow
@settings(max_examples=50)
@given(data=st.data(), n=st.integers(10, 60))
def test_battery_data_format_makes_the_round_trip(tmp_path_factory, data, n):
    path = tmp_path_factory.mktemp("bdf") / "a.csv"
    time = np.cumsum(data.draw(arrays(float, n, elements=st.floats(0.5, 100))))
    current = data.draw(arrays(float, n, elements=finite))
    # A resistor's voltage, so that the sign check has nothing to object to.
    voltage = 3.7 - 0.03 * current
    made = segment(Trajectory(time, current, voltage, np.full(n, 298.15)))
    write(made, path)
    found = read_record(path).trajectory
    assert np.array_equal(found.time, made.time)
    assert np.array_equal(found.voltage, made.voltage)
    assert np.array_equal(found.current, made.current)
    np.testing.assert_allclose(found.temperature, made.temperature, atol=1e-9)
    assert found.steps == made.steps


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_samples_that_no_instrument_took_are_not_written_and_come_back(tmp_path, suffix):
    """Sampled every minute: only the counter tells that a pulse lasted from 20 s to 345 s."""
    time = np.concatenate([np.arange(0.0, 301.0, 60.0), [330.0], np.arange(390.0, 1000.0, 60.0)])
    pulsed = (time > 20.0) & (time < 345.0)
    drawn_ah = 2.0 * np.clip(time - 20.0, 0.0, 325.0) / 3600.0
    voltage = np.where(pulsed, 3.5, 3.7) - 0.05 * drawn_ah
    rows = [f"{t},{v},{-2.0 * p},0,{q}" for t, v, p, q in zip(time, voltage, pulsed, drawn_ah, strict=True)]
    original = tmp_path / "original.csv"
    header = "Time [s],U[V],I[A],Charge Capacity [Ah],Discharge Capacity [Ah]"
    original.write_text("\n".join([header, *rows]))
    record = read_record(original)
    assert record.trajectory.inserted.sum() == 4
    copy = tmp_path / f"copy{suffix}"
    write(record, copy)
    columns = pd.read_csv(copy) if suffix == ".csv" else pd.read_parquet(copy)
    assert len(columns["Voltage / V"]) == len(time)
    assert columns["Discharging Capacity / Ah"].iloc[-1] == pytest.approx(drawn_ah[-1], rel=1e-9)
    found = read_record(copy)
    np.testing.assert_array_equal(found.trajectory.inserted, record.trajectory.inserted)
    np.testing.assert_allclose(found.trajectory.time, record.trajectory.time, atol=1e-6)
    np.testing.assert_array_equal(found.trajectory.voltage, record.trajectory.voltage)
    assert found.trajectory.steps == record.trajectory.steps


ARBIN = ["Data_Point", "Test_Time(s)", "Date_Time", "Cycle_Index", "Current(A)", "Voltage(V)"]


def workbook(path, sheets, start=datetime.datetime(2010, 8, 17)):
    book = openpyxl.Workbook()
    book.active.title = "Info"
    book.active["D1"] = "TEST REPORT"
    for title, (offset_s, made) in sheets.items():
        sheet = book.create_sheet(title)
        sheet.append(ARBIN)
        for k in range(len(made)):
            date = start + datetime.timedelta(seconds=offset_s + float(made.time[k]))
            sheet.append([k + 1, float(made.time[k]), date, 1, -float(made.current[k]), float(made.voltage[k])])
    book.save(path)


def test_arbin_sheets_whose_clock_restarts_are_joined(tmp_path):
    one = cycling(1)
    path = tmp_path / "cell.xlsx"
    workbook(path, {"Channel_1-008_2": (10_000, one), "Channel_1-008_1": (0, one)})
    record = read_record(path)
    assert len(record.trajectory) == 2 * len(one)
    assert record.trajectory.cycles == (1, 2)
    assert record.trajectory.time[len(one)] == pytest.approx(10_000, abs=1)
    notes = " | ".join(record.notes)
    assert '2 parts were joined by date: "sheet Channel_1-008_1", "sheet Channel_1-008_2"' in notes
    assert "the clock restarts in row 2 of sheet Channel_1-008_2; it was carried on" in notes
    alone = read_record(path, ReadOptions(sheet="Channel_1-008_1"))
    assert len(alone.trajectory) == len(one)
    with pytest.raises(BsaError, match="has no sheet") as raised:
        read_record(path, ReadOptions(sheet="Chanel_1-008_1"))
    assert 'did you mean "Channel_1-008' in raised.value.hint


def test_channels_of_a_workbook_are_different_cells(tmp_path):
    one = cycling(1)
    path = tmp_path / "cells.xlsx"
    sheets = {"Channel_1-003_1": (0, one), "Channel_1-003_2": (10_000, one), "Channel_1-004_1": (20_000, one)}
    workbook(path, sheets)
    with pytest.raises(
        BsaError, match=r'2 channels, and each is a cell of its own: "Channel_1-003", "Channel_1-004"'
    ) as raised:
        read_record(path)
    assert '--sheet "Channel_1-003"' in raised.value.hint
    assert "--join" in raised.value.hint
    for options, count in (({"sheet": "Channel_1-003"}, 2), ({"sheet": "Channel_1-003_2"}, 1), ({"join": True}, 3)):
        assert len(read_record(path, ReadOptions(**options)).trajectory) == count * len(one), options


@pytest.mark.parametrize("title", ["Statistics_1-008", "Cycles", "Data"])
def test_the_statistics_of_a_workbook_are_no_samples(tmp_path, title):
    one = cycling(1)
    path = tmp_path / "cell.xlsx"
    workbook(path, {"Channel_1-008": (0, one), title: (0, last(one))})
    record = read_record(path)
    assert len(record.trajectory) == len(one)
    assert not any("restart" in note for note in record.notes)


def last(made: Trajectory) -> Trajectory:
    return Trajectory(made.time[-1:], made.current[-1:], made.voltage[-1:])


def test_a_table_with_a_row_for_each_cycle_is_known_by_its_columns(tmp_path):
    one = cycling(1)
    path = tmp_path / "cell.xlsx"
    workbook(path, {"Samples": (0, one), "Cycles": (0, last(one))})
    book = openpyxl.load_workbook(path)
    book["Cycles"].cell(1, len(ARBIN) + 1, "Vmax_On_Cycle(V)")
    book.save(path)
    assert len(read_record(path).trajectory) == len(one)


def test_a_folder_of_workbooks_is_joined_in_the_order_of_its_dates(tmp_path):
    folder = tmp_path / "CS2"
    folder.mkdir()
    one = cycling(1)
    workbook(folder / "CS2_9_1_10.xlsx", {"Channel_1-008": (0, one)}, datetime.datetime(2010, 9, 1))
    workbook(folder / "CS2_10_1_09.xlsx", {"Channel_1-008": (0, one)}, datetime.datetime(2009, 10, 1))
    record = read_record(folder)
    assert record.trajectory.cycles == (1, 2)
    assert record.trajectory.duration > 300 * 86400
    assert '2 parts were joined by date: "CS2_10_1_09.xlsx", "CS2_9_1_10.xlsx".' in record.notes


def test_digatron(tmp_path):
    made = discharge()
    lines = [
        "",
        "Battery Name,LG M50",
        "",
        "Step,Status,Prog Time,Voltage,Current,LogTemp001,",
        "[],[],[ss.xxx],[V],[A],[T1],",
    ]
    for t, v, i in zip(made.time, made.voltage, -made.current, strict=True):
        lines.append(f"5,PAU,{t},{v:.6f},{i},24.5,")
    path = tmp_path / "cell.csv"
    path.write_text("\r\n".join(lines))
    record = read_record(path)
    assert_same(record.trajectory, made)
    assert record.trajectory.temperature[0] == pytest.approx(297.65)


def test_control_characters_in_names_are_escaped(tmp_path):
    path = tmp_path / "a\x1b[31m\n.csv"
    path.write_text(table(discharge(), "Time [s],U[V],\x07I\x1b[2J[B]"))
    with pytest.raises(BsaError) as raised:
        read_record(path)
    assert str(raised.value).isprintable()
    assert "\\x1b" in str(raised.value)


def test_every_reader_is_listed_and_fits_the_protocol():
    names = installed().names("reader")
    assert {"bdf-csv", "generic-csv", "arbin-xlsx", "digatron-csv"} <= set(names)
    for name in names:
        entry = installed().find("reader", name).entry
        assert isinstance(entry.factory(entry.config_type()), Reader)


START = datetime.datetime(2024, 2, 29, 23, 50)


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("Time", lambda passed: str(passed)),
        ("Test Time (hh:mm:ss.ms)", lambda passed: f"{passed}.000"),
        ("DateTime", lambda passed: (START + passed).isoformat()),
        ("Datum/Zeit", lambda passed: (START + passed).strftime("%d.%m.%Y %H:%M:%S")),
        ("Timestamp", lambda passed: repr((START + passed).replace(tzinfo=datetime.UTC).timestamp())),
    ],
)
def test_clocks_and_dates_are_a_time(tmp_path, name, written):
    lines = table(discharge(), f"{name},U[V],I[A]").splitlines()
    for row, line in enumerate(lines[1:], 1):
        seconds, rest = line.split(",", 1)
        lines[row] = f"{written(datetime.timedelta(seconds=float(seconds)))},{rest}"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(read_record(path).trajectory.time, discharge().time)
    np.testing.assert_allclose(read_record(path, ReadOptions(columns={"time": name})).trajectory.time, discharge().time)


def test_dates_and_spans_of_a_table_of_arrays_are_a_time():
    seconds = discharge().time
    columns = [discharge().voltage, -discharge().current]
    for time in (
        np.datetime64(START, "ns") + (seconds * 1e9).astype("timedelta64[ns]"),
        seconds.astype("timedelta64[s]"),
    ):
        read = read_table(ArrayTable("a", ("Date Time", "U[V]", "I[A]"), [time, *columns]), ReadOptions())
        np.testing.assert_allclose(read.time, seconds)


def test_sheets_of_no_channel_are_joined_where_one_clock_runs_through_them(tmp_path):
    one = cycling(1)
    path = tmp_path / "cell.xlsx"
    workbook(path, {"Cell A": (0, one), "Cell B": (10_000, one)})
    with pytest.raises(BsaError, match='the clock begins anew in "Cell B"') as raised:
        read_record(path)
    assert '--sheet "Cell A"' in raised.value.hint
    assert len(read_record(path, ReadOptions(join=True)).trajectory) == 2 * len(one)
    later = one.changed(time=one.time + 10_000.0)
    workbook(path, {"Data": (0, one), "Data (2)": (0, later)})
    assert len(read_record(path).trajectory) == 2 * len(one)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_commas_that_part_thousands_are_refused_whatever_parts_the_cells(tmp_path, separator):
    path = tmp_path / "a.txt"
    rows = ([f"{10 * k}.0", f"{4.19 - 0.001 * k:.4f}", "-2,000"] for k in range(50))
    path.write_text(
        separator.join(["Time (s)", "Voltage (V)", "Current (mA)"]) + "\n" + "\n".join(map(separator.join, rows))
    )
    with pytest.raises(BsaError, match='"-2,000" is not a number'):
        read_record(path)


def test_decimal_commas_are_seen_below_a_row_of_whole_numbers(tmp_path):
    path = tmp_path / "a.csv"
    rows = (f"{30 * k};{'4' if k == 0 else f'3,{990 - k}'};-2" for k in range(50))
    path.write_text("Time [s];U [V];I [A]\n" + "\n".join(rows))
    assert read_record(path).trajectory.voltage[1] == 3.989


def saved_sheet(path, *rows):
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


@pytest.mark.parametrize(
    ("names", "units", "scale"),
    [
        (["Time", "Current", "Voltage"], ["s", "A", "V"], (1.0, 1.0, 1.0)),
        (["Time", "Current", "Voltage"], ["[min]", "[mA]", "[mV]"], (1 / 60, 1e3, 1e3)),
    ],
)
def test_a_row_of_units_may_stand_below_the_names_of_a_sheet(tmp_path, names, units, scale):
    made = discharge()
    rows = zip(made.time * scale[0], -made.current * scale[1], made.voltage * scale[2], strict=True)
    path = saved_sheet(tmp_path / "a.xlsx", names, units, *(list(map(float, row)) for row in rows))
    assert_same(read_record(path).trajectory, made)


def test_a_sheet_may_have_dates_alone_and_texts_with_decimal_commas(tmp_path):
    made, start = discharge(), datetime.datetime(2024, 3, 1, 23, 50)
    rows = [
        [start + datetime.timedelta(seconds=float(t)), f"{-i:.1f}".replace(".", ","), f"{v:.7f}".replace(".", ",")]
        for t, i, v in zip(made.time, made.current, made.voltage, strict=True)
    ]
    record = read_record(saved_sheet(tmp_path / "a.xlsx", ["Date_Time", "Current(A)", "Voltage(V)"], *rows))
    assert_same(record.trajectory, made)
    assert "decimal commas were read as decimal points." in record.notes
