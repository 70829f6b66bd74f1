"""Each malformed file gives one line with the place and the value, and a hint."""

from __future__ import annotations

import gzip
import zipfile

import numpy as np
import openpyxl
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.plugins.readers import arbin_xlsx, source, table
from pydantic import ValidationError

HEADER = "Test Time / s,Voltage / V,Current / A"


def rows(n: int = 100, voltage: float = 1.0, current: float = 1.0, time: float = 1.0) -> list[str]:
    """A 1C discharge of a 5 Ah cell as a cycler writes it."""
    return [f"{10 * k * time:.6g},{(4.1 - 0.01 * k) * voltage:.6g},{-5 * current:.6g}" for k in range(n)]


def text(lines: list[str], header: str = HEADER) -> bytes:
    return "\n".join([header, *lines]).encode()


def with_row(k: int, row: str) -> bytes:
    lines = rows()
    lines[k] = row
    return text(lines)


def with_voltage(value: str, every: int) -> bytes:
    return text([f"{10 * k},{value if k % every == 0 else 4.1 - 0.01 * k},-5" for k in range(100)])


def charge_then_discharge(sign: float) -> bytes:
    up = [f"{10 * k},{3.0 + 0.01 * k:.4f},5" for k in range(100)]
    down = [f"{2000 + 10 * k},{4.0 - 0.01 * k:.4f},{5 * sign}" for k in range(100)]
    return text(up + [f"{1000 + 10 * k},4.0,0" for k in range(100)] + down)


CASES = {
    "empty": ("a.csv", b"", "a.csv is empty", "export"),
    "only blank lines": ("a.csv", b"\n\n \n", "is empty", "export"),
    "header only": ("a.csv", (HEADER + "\n").encode(), "no rows of numbers", "export"),
    "prose": ("a.csv", b"Dear all\nplease find the data attached\n", "holds no table of numbers", "one row a sample"),
    "binary": ("a.csv", b"\x89PNG\r\n\x00\x01" * 50, "is not text (a zero byte at offset 6)", "CSV"),
    "damaged gzip": ("a.csv.gz", gzip.compress(text(rows()))[:60], "a.csv.gz is a damaged gzip file", "again"),
    "not gzip": ("a.csv.gz", text(rows()), "a damaged gzip file", "again"),
    "unknown kind": ("a.pdf", b"%PDF-1.4", "no reader recognises the file a.pdf", "bdf-csv"),
    "no current": ("a.csv", text(rows(), "Test Time / s,Voltage / V,Amperage"), "no column for current", '"Amperage"'),
    "capacities by cycle": (
        *("a.csv", text([f"{k},{1.1 - 0.001 * k}" for k in range(1, 50)], "cycle,capacity / A.h")),
        *("a.csv is a table with one row for each cycle: it has no column for time, voltage, current", "whole curves"),
    ),
    "no voltage": ("a.csv", text(rows(), "Time [s],Potato,I[A]"), "no column for voltage", "--column voltage=NAME"),
    "no names": ("a.csv", b"\n".join(r.encode() for r in rows()), "no column for time", '"1", "2", "3"'),
    "two voltages": (
        *("a.csv", text([r + ",4" for r in rows()], HEADER + ",Voltage / V")),
        *('2 columns for voltage: "Voltage / V", "Voltage / V"', "--column voltage=NAME"),
    ),
    "unknown unit": ("a.csv", text(rows(), "Time [s],U[furlong],I[A]"), '"furlong", which is no unit of voltage', "mV"),
    "text in a cell": (
        *("a.csv", with_row(10, "100,overload,-5")),
        *('row 12, column "Voltage / V": "overload" is not a number', "repair"),
    ),
    "texts in a column": (
        *("a.csv", with_voltage("OVL", 5)),
        *('row 2, column "Voltage / V": "OVL" is not a number (20 of 100 rows are so)', "repair or remove these rows"),
    ),
    "clock times": ("a.csv", with_row(10, "00:01:40,4.0,-5"), 'row 12, column "Test Time / s": "00:01:40"', "seconds"),
    "short row": ("a.csv", with_row(10, "100,4.0"), "row 12 has fewer cells than the 3 columns", "repair"),
    "long row": ("a.csv", with_row(10, "100,4,0,-5"), "row 12 has more cells than the 3 columns", "decimal commas"),
    "open quote": ("a.csv", with_row(10, '100,"4.0,-5'), "quotation mark opened in row 12 is not closed", "repair"),
    "stub": ("a.csv", text(rows(5)), "has only 5 samples; at least 10", "stub"),
    "many holes": ("a.csv", with_voltage("NaN", 4), 'column "Voltage / V" has no number in 25 of 100 rows', "fill"),
    "infinite": ("a.csv", with_voltage("inf", 3), "has no number in 34 of 100 rows, first in row 2", "fill"),
    "millivolts": ("a.csv", text(rows(voltage=1000)), 'column "Voltage / V" shows 3605 V', "--unit voltage=mV"),
    "kilovolts": ("a.csv", text(rows(voltage=0.001)), "shows at most 0.0041 V", "--unit voltage=V"),
    "a pack": ("a.csv", text(rows(voltage=4)), "more than a single cell can have", "not of a pack"),
    "milliamperes": ("a.csv", text(rows(current=1000)), 'column "Current / A" shows 5000 A', "--unit current=mA"),
    "hours": ("a.csv", text(rows(time=1 / 3600)), 'column "Test Time / s" shows 0.275 s in all', "--unit time=h"),
    "days of a spreadsheet": (
        "a.csv",
        text([f"{45364.9 + k / 8640:.6f},{4.1 - 0.01 * k:.6g},-5" for k in range(100)]),
        'column "Test Time / s" shows 0.011458 s in all',
        "--unit time=d",
    ),
    "kelvin": (
        *("a.csv", text([r + ",298.1" for r in rows()], HEADER + ",Temperature T1 / degC")),
        *('column "Temperature T1 / degC" shows 298.1 degC', "--unit temperature=K"),
    ),
    "swapped": (
        *("a.csv", text(rows(), "Time [s],I[A],U[V]")),
        *('column "U[V]" has a median of -5 V', "are two columns swapped?"),
    ),
    "wrong sign": (
        *("a.csv", text(rows(current=-1))),
        *("is 5 A while the voltage falls from 4.1 V (row 2) to 3.11 V (row 101)", "--current-sign discharge-positive"),
    ),
    "no sign": ("a.csv", charge_then_discharge(1.0), "never changes its sign", "with its sign"),
    "no current flows": (
        "a.csv",
        text(rows(current=0)),
        "is 0 A throughout while the voltage moves",
        "--column current",
    ),
    "restart": ("a.csv", text(rows() + rows()), "the clock restarts in row 102 (990 s, then 0 s)", "--where"),
    "shuffled": (
        *("a.csv", text([rows()[k ^ 1] for k in range(100)])),
        *("the time runs back in 50 of 100 rows, first in row", "sort"),
    ),
    "still clock": ("a.csv", text(rows(time=0)), "never rises (it stays at 0 s)", "--column time=NAME"),
    "coarse clock": (
        *("a.csv", text([f"{k // 4},{4.1 - 0.001 * k},-5" for k in range(100)])),
        *("75 of 100 rows repeat the time of the row before, first row 3", "more digits"),
    ),
    "loose wire": ("a.csv", with_voltage("0.1", 5), "jumps for a single sample", "sense wire"),
    "a stretch of nonsense": (
        *("a.csv", text([f"{10 * k},{9.9 if 40 < k < 46 else 4.1 - 0.01 * k},-5" for k in range(100)])),
        *('row 43, column "Voltage / V": 9.9 V is no voltage of a single cell (-0.01 to 6 V); 5 such rows', "repair"),
    ),
    "csv named xlsx": ("a.xlsx", text(rows()), "a.xlsx is not an Excel workbook", ".xlsx"),
    "old workbook": (
        "a.xls",
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" * 100,
        "a.xls is no workbook, or a damaged one",
        "save it as .xlsx",
    ),
    "a pickle": ("a.pkl", b"cos\nsystem\n(S'true'\ntR.", "holds Python objects; it is not opened", "read_pickle"),
    "damaged utf-16": ("a.csv", b"\xff\xfe" + text(rows())[:41], "damaged UTF-16", "UTF-8"),
}


def refused(path, options: ReadOptions | None = None) -> BsaError:
    with pytest.raises(BsaError) as raised:
        read_record(path, options)
    line = str(raised.value)
    assert line.isprintable(), line
    assert "\n" not in line
    assert raised.value.hint
    assert line.count("Traceback") == 0
    return raised.value


@pytest.mark.parametrize(("name", "content", "message", "hint"), CASES.values(), ids=CASES.keys())
def test_one_line_and_a_hint(tmp_path, name, content, message, hint):
    path = tmp_path / name
    path.write_bytes(content)
    error = refused(path)
    assert message in error.message
    assert hint in error.hint
    assert name in error.message
    # Nothing lost: the file is as it was.
    assert path.read_bytes() == content


def test_a_missing_file(tmp_path):
    assert "there is no file" in refused(tmp_path / "nope.csv").message


def test_a_folder(tmp_path):
    assert "no reader recognises the folder" in refused(tmp_path).message


@pytest.mark.parametrize(
    ("options", "message", "hint"),
    [
        ({"columns": {"voltage": "Voltage"}}, '"Voltage" is not a column of a.csv', 'did you mean "Voltage / V"?'),
        ({"columns": {"voltage": "Current / A"}}, "is named for both voltage and current", "--column current=NAME"),
        ({"units": {"voltage": "kV"}}, '"kV", which is no unit of voltage', "V or mV"),
        ({"where": {"cycle": "3"}}, '"cycle" is not a column', "Columns:"),
        ({"where": {"Current / A": "3"}}, "no row where Current / A is 3", 'values there: "-5"'),
        ({"cycles": (7, 9)}, "has cycles 1 to 1, not 7 to 9", "--cycles"),
        ({"current_sign": "discharge-positive"}, "so it is not discharge-positive", "--current-sign charge-positive"),
    ],
)
def test_options_that_do_not_fit_the_file(tmp_path, options, message, hint):
    path = tmp_path / "a.csv"
    path.write_bytes(text(rows()))
    error = refused(path, ReadOptions(**options))
    assert message in error.message
    assert hint in error.hint


def test_a_reader_that_does_not_exist(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(text(rows()))
    with pytest.raises(BsaError, match='there is no reader "bdf"') as raised:
        read_record(path, reader="bdf")
    assert "bdf-csv" in raised.value.hint


def test_auto_does_not_guess(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(text([f"{10 * k},3.7,{5 * (k % 2)}" for k in range(100)]))
    assert "does not tell the sign" in refused(path, ReadOptions(current_sign="auto")).message


@pytest.mark.parametrize(
    "options", [{"cycles": (3, 2)}, {"cycles": (0, 2)}, {"colums": {}}, {"columns": {"volts": "x"}}]
)
def test_options_are_checked(options):
    with pytest.raises(ValidationError):
        ReadOptions(**options)


def sheet_of(path, lines, title="Channel_1-001", header=("Test_Time(s)", "Current(A)", "Voltage(V)")):
    book = openpyxl.Workbook()
    book.active.title = title
    book.active.append(header)
    for line in lines:
        book.active.append(line)
    book.save(path)


def test_workbooks(tmp_path):
    path = tmp_path / "a.xlsx"
    good = [[10.0 * k, -5.0, 4.1 - 0.01 * k] for k in range(100)]
    sheet_of(path, good, header=("a", "b", "c"))
    assert "no sheet with columns for time, voltage and current" in refused(path).message
    assert "no column for time" in refused(path, ReadOptions(sheet="Channel_1-001")).message

    bad = [list(line) for line in good]
    bad[7][2] = "#VALUE!"
    sheet_of(path, bad)
    notes = read_record(path).notes
    assert "1 sample without a value was left out (row 9 of sheet Channel_1-001)." in notes

    bad[7][2] = "overload"
    sheet_of(path, bad)
    assert 'sheet Channel_1-001, row 9, column "Voltage(V)": "overload"' in refused(path).message

    formulas = [[t, i, f"=A{k}+1"] for k, (t, i, _) in enumerate(good, 2)]
    sheet_of(path, formulas)
    error = refused(path)
    assert "has no number in 100 of 100 rows" in error.message
    assert "formulas" in error.hint

    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "begins like an Excel workbook of today's kind (.xlsx) but is damaged" in refused(path).message


def test_a_zip_that_is_no_workbook(tmp_path):
    path = tmp_path / "a.xlsx"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("x.txt", "hello")
    assert "a.xlsx is no workbook, or a damaged one" in refused(path).message


def test_a_zip_bomb_is_not_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "a.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("xl/worksheets/sheet1.xml", b" " * 2_000_000)
    monkeypatch.setattr(source, "RATIO_BYTES", 1_000_000)
    assert "times its size; the limit is 300" in refused(path).message
    monkeypatch.setattr(arbin_xlsx, "MAX_UNPACKED_BYTES", 1_000_000)
    assert "more than the limit" in refused(path).message


@pytest.mark.slow
def test_huge_files_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(text(rows(200_000))))
    monkeypatch.setattr(source, "MAX_BYTES", 2**20)
    assert "holds more than 1 MiB" in refused(path).message
    monkeypatch.undo()
    monkeypatch.setattr(table, "MAX_SAMPLES", 1000)
    path = tmp_path / "b.csv"
    path.write_bytes(text(rows(2000)))
    assert "has more than 1000 rows" in refused(path).message


@pytest.mark.slow
def test_flipped_bytes_never_give_a_traceback(tmp_path):
    rng = np.random.default_rng(0)
    good = text(rows())
    errors = []
    for k in range(150):
        data = bytearray(good)
        for place in rng.integers(0, len(data), 1 + k % 8):
            data[place] = rng.integers(0, 256)
        path = tmp_path / f"a{k}.csv"
        path.write_bytes(bytes(data))
        try:
            read_record(path)
        except BsaError as error:
            errors.append(error)
    assert errors
    assert all(str(error).isprintable() and error.hint for error in errors)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("start", "step"), [(1e303, 1e300), (0.0, 1e303), (-1e303, 1e301), (1e303, 0.0)])
@pytest.mark.parametrize("unit", ["s", "h"])
def test_times_that_no_clock_shows_are_refused_by_their_row(tmp_path, start, step, unit):
    path = tmp_path / "record.csv"
    lines = [f"{start + step * k!r},{4.1 - 0.001 * k:.4f},{-1.0 if k > 2 else 0.0}" for k in range(60)]
    path.write_text(f"Test Time / {unit},Voltage / V,Current / A\n" + "\n".join(lines))
    with pytest.raises(BsaError, match=r"record\.csv.*(is no measured number|has no number)"):
        read_record(path)


def test_a_file_without_a_header_is_told_all_that_it_takes(tmp_path):
    path = tmp_path / "discharge.txt"
    path.write_text("".join(f"{k}\t{4.1 - 0.01 * k}\n" for k in range(40)))
    with pytest.raises(BsaError, match="has no column for time, voltage, current") as raised:
        read_record(path)
    assert '"1", "2"' in raised.value.hint
    assert "--column time=NAME --column voltage=NAME --column current=NAME" in raised.value.hint
    assert "--constant-current" in raised.value.hint


@pytest.mark.parametrize(
    ("numbers", "hint"),
    [
        ((7, 8, 9), "choose one with --where 'Test No=7' (here the first), or say --join"),
        ((7, 8, 7), "no column tells them apart, so cut the file there"),
    ],
)
def test_the_columns_that_number_the_tests_of_a_file_are_named(tmp_path, numbers, hint):
    path = tmp_path / "a.csv"
    lines = [f"{row},{number},1,{place}" for number in numbers for place, row in enumerate(rows())]
    path.write_bytes(text(lines, HEADER + ",Test No,Same,Row"))
    error = refused(path)
    assert "the clock restarts in row 102" in error.message
    assert hint in error.hint
    read_record(path, ReadOptions(join=True))
    if "where" in hint.split(",")[0]:
        assert len(read_record(path, ReadOptions(where={"Test No": "7"})).trajectory) == 100
