"""Tables as cyclers write them: in layers, in curves, with units beneath the names, in quotation marks."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from bsa.plugins.readers.generic_csv import GenericCsv
from bsa.plugins.readers.table import find_table

SECONDS = 60 * np.arange(12)
VOLTS = np.round(4.2 - 0.01 * np.arange(12), 3)

ENGLISH = (
    "Cycle Index,Chg. Cap.(Ah),DChg. Cap.(Ah)",
    ",Step Index,Step Type,Step Time",
    ",,DataPoint,Time,Total Time,Current(A),Voltage(V),Capacity(Ah)",
)
CHINESE = (
    "循环序号,充电容量(Ah),放电容量(Ah)",
    ",工步序号,工步类型,工步时间",
    ",,数据序号,时间,总时间,电流(A),电压(V),容量(Ah)",
)


def samples(tmp_path, lines, name: str = "a.csv", options: ReadOptions | None = None, encoding="utf-8") -> Samples:
    path = tmp_path / name
    path.write_bytes("\n".join(lines).encode(encoding))
    found = GenericCsv().read(path, options or ReadOptions())
    assert isinstance(found, Samples)
    return found


def layered(names: tuple[str, ...], joined: bool) -> list[str]:
    """Two cycles of two steps of three records each; joined, the first step stands in the line of its cycle."""
    lines = list(names)
    for k, (time, voltage) in enumerate(zip(SECONDS, VOLTS, strict=True)):
        step = f",{k // 3 % 2 + 1},CC DChg,00:03:00"
        if k % 6 == 0:
            lines.append(f"{k // 6 + 1},0.5,0.5" + step * joined)
        if k % 3 == 0 and not (joined and k % 6 == 0):
            lines.append(step)
        lines.append(f",,{k + 1},00:0{k % 3}:00,00:{time // 60:02}:00,-0.5,{voltage},0.1")
    return lines


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize(("names", "encoding"), [(ENGLISH, "utf-8"), (CHINESE, "gb18030")])
def test_the_records_of_a_layered_export_have_the_numbers_of_their_cycle_and_step(tmp_path, names, encoding, joined):
    found = samples(tmp_path, layered(names, joined), encoding=encoding)
    np.testing.assert_allclose(found.time, SECONDS)
    np.testing.assert_allclose(found.voltage, VOLTS)
    np.testing.assert_allclose(found.current, -0.5)
    np.testing.assert_allclose(found.extra["cycle"], np.repeat([1, 2], 6))
    np.testing.assert_allclose(found.extra["step"], np.tile(np.repeat([1, 2], 3), 2))
    assert found.rows[0] == (5 if joined else 6)


def test_a_layered_export_may_have_decimal_commas_and_separators_at_the_ends_of_lines(tmp_path):
    lines = [line.replace(",", ";").replace(".", ",") + ";;" for line in layered(ENGLISH, False)]
    np.testing.assert_allclose(samples(tmp_path, lines).voltage, VOLTS)


def test_a_line_of_a_layered_export_that_begins_with_a_word_is_refused(tmp_path):
    lines = layered(ENGLISH, False)
    lines[7] = "x" + lines[7]
    with pytest.raises(BsaError, match='row 8 begins with "x", which is no number of a cycle or a step'):
        samples(tmp_path, lines)


def test_indented_lines_alone_make_no_layers(tmp_path):
    lines = [",,note", "a,b,c", *("Time [s],Voltage [V],Current [A]", "0,4.2,-1", "60,4.1,-1", "120,4.0,-1")]
    np.testing.assert_allclose(samples(tmp_path, lines).voltage, [4.2, 4.1, 4.0])


@pytest.mark.parametrize("units", ["s;V;mA;;°C", "s;;mA;;", ";V;mA;#;deg C", "s;V;mA;;℃"])
def test_a_row_of_units_needs_no_brackets(tmp_path, units):
    rows = (f"{time};{voltage};-500;REST;25" for time, voltage in zip(SECONDS, VOLTS, strict=True))
    found = samples(tmp_path, ["Zeit;Spannung;Strom;Zustand;Temperatur", units, *rows])
    np.testing.assert_allclose(found.time, SECONDS)
    np.testing.assert_allclose(found.current, -0.5)


@pytest.mark.parametrize("above", ["a;1;c", "a;;c", "V;A;h"])
def test_names_like_units_are_no_row_of_units_beneath_what_names_no_columns(above):
    assert find_table(f"{above}\nh;V;A\n0;4.2;-1\n1;4.1;-1", "a").header == ("h", "V", "A")


NAMES = "\tPt\tT\tVf\tIm\tTemp"
UNITS = "\t#\ts\tV vs. Ref.\tA\tdeg C"


def curve(title: str, count: int, volts: float, names: str = NAMES, start: int = 0) -> list[str]:
    rows = (f"\t{k}\t{start + 60 * k}\t{volts - 0.01 * k:.4f}\t-5.00000E-01\t25.0" for k in range(count))
    return [f"{title}\tTABLE\t{count}", names, UNITS, *rows]


HEAD = ["EXPLAIN", "TAG\tPWR800", "AREA\tQUANT\t1.0\t2.0", *curve("OCVCURVE", 3, 1.0, NAMES.replace("Im", "Vm"))]


def test_the_curves_of_gamry_s_files_follow_each_other(tmp_path):
    lines = [*HEAD, *curve("CURVE1", 5, 4.2), "EXPERIMENTABORTED\tTOGGLE\tF", *curve("CURVE2", 7, 4.0)]
    found = samples(tmp_path, lines, "a.DTA")
    np.testing.assert_allclose(found.time, 60.0 * np.array([*range(5), *range(4, 11)]))
    np.testing.assert_allclose(found.voltage[[0, 4, 5, 11]], [4.2, 4.16, 4.0, 3.94])
    np.testing.assert_allclose(found.extra["step"], np.repeat([1, 2], [5, 7]))
    assert found.rows[0] == len(HEAD) + 4
    assert "the clock restarts with each of 2 curves; each was taken to begin when the one before it ended." in (
        found.notes
    )
    second = samples(tmp_path, lines, "a.DTA", ReadOptions(columns={"voltage": "Vf"}, where={"Step": "2"}))
    np.testing.assert_allclose(second.voltage[0], 4.0)


def test_one_curve_of_gamry_s_needs_no_note_and_may_have_decimal_commas(tmp_path):
    lines = [*HEAD, *(line.replace(".", ",") for line in curve("CURVE", 5, 4.2))]
    lines[len(HEAD) + 2] = UNITS
    found = samples(tmp_path, lines, "a.dta")
    np.testing.assert_allclose(found.voltage, 4.2 - 0.01 * np.arange(5))
    assert found.notes == ("decimal commas were read as decimal points.",)


def test_curves_of_gamry_s_whose_clock_goes_on_are_left_as_they_are(tmp_path):
    lines = [*HEAD, *curve("CURVE1", 5, 4.2), *curve("CURVE2", 4, 4.0, start=240)]
    found = samples(tmp_path, lines, "a.DTA")
    np.testing.assert_allclose(found.time, 60.0 * np.array([*range(5), *range(4, 8)]))


def test_curves_of_gamry_s_with_other_columns_are_refused(tmp_path):
    lines = [*HEAD, *curve("CURVE1", 5, 4.2), *curve("CURVE2", 5, 4.0, NAMES.replace("Im", "Vu"))]
    with pytest.raises(BsaError, match="the curve in row 18 has other columns or units than the one in row 10"):
        samples(tmp_path, lines, "a.DTA")


def test_lines_that_stand_in_quotation_marks_as_a_whole_are_read(tmp_path):
    rows = (f'"{time / 3600:.7f},-0.5,{voltage}"' for time, voltage in zip(SECONDS, VOLTS, strict=True))
    lines = ["[Data]", '"   [End step, or not]"', '"Run Time (h),Current (A),Potential (V)"', *rows]
    found = samples(tmp_path, lines)
    np.testing.assert_allclose(found.voltage, VOLTS)
    np.testing.assert_allclose(found.time, SECONDS, atol=0.01)


def test_quotation_marks_around_cells_are_left_to_the_cells(tmp_path):
    lines = ['"Time [s]","Voltage [V]","Current [A]"', '"0","4,2","-1"', '"60","4,1","-1"', '"120","4,0","-1"']
    np.testing.assert_allclose(samples(tmp_path, lines).voltage, [4.2, 4.1, 4.0])


PREAMBLE = ["operator;N. N.;;", "15;started;;", "0;0;;", "# data;;;"]
RECORD = ["test_time;voltage;current;step", *(f"{60 * k};{4.2 - 0.01 * k:.2f};-1;1" for k in range(9))]


def test_a_lone_row_of_numbers_in_a_preamble_is_no_table(tmp_path):
    found = samples(tmp_path, [*PREAMBLE, *RECORD])
    np.testing.assert_allclose(found.voltage, 4.2 - 0.01 * np.arange(9))
    assert found.rows[0] == len(PREAMBLE) + 2


@pytest.mark.parametrize("second", ["pause;;;", "-;-;-;-", "60;x;y;z"])
def test_a_first_row_before_one_without_numbers_is_not_dropped(second):
    table = find_table("\n".join([*RECORD[:2], second, *RECORD[3:]]), "a")
    assert table.header == ("test_time", "voltage", "current", "step")
    assert next(number for number, _ in table.cells()) == 2


@pytest.mark.parametrize("mark", ["#", "%", "//"])
def test_a_mark_before_the_names_moves_none_of_them(tmp_path, mark):
    """`numpy.savetxt` writes one: each name had stood for the column beside its own."""
    rows = [f"{time} {voltage} -0.5 {voltage}" for time, voltage in zip(SECONDS, VOLTS, strict=True)]
    found = samples(tmp_path, [f"{mark} time U I Uset", *rows])
    np.testing.assert_allclose([found.time, found.voltage], [SECONDS, VOLTS])
    np.testing.assert_allclose(samples(tmp_path, [f"{mark} n U I t", *rows], options=NUMBERED).time, VOLTS)


NUMBERED = ReadOptions(columns={"time": "t"})
