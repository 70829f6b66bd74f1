"""Maccor exports, old and new: the sign comes from the state, times are understood."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from bsa.testing import ReaderConformance

STATES = ["R"] * 20 + ["D"] * 60 + ["R"] * 20 + ["C"] * 60
AMPERES = {"R": 0.0, "D": 2.0, "C": 1.0}


def old(seconds: bool) -> str:
    head = "Today's Date 03/05/2024\tDate of Test: 03/01/2024\tFilename: a.000\n"
    lines = ["Rec#\tCyc#\tStep\tTestTime\tStepTime\tAmp-hr\tWatt-hr\tAmps\tVolts\tState\tES\tDPt Time\tTemp 1"]
    if seconds:
        lines[0] = lines[0].replace("TestTime", "Test (Sec)")
    for k, (state, volts) in enumerate(zip(STATES, voltages(), strict=True)):
        t = 10 * k + 86400
        words = str(t) if seconds else f"  {t // 86400}d {t % 86400 // 3600:02d}:{t % 3600 // 60:02d}:{t % 60:02d}.00"
        stamp = f"03/01/2024 {12 + k // 360}:{k // 6 % 60:02d}:{k % 6 * 10:02d}"
        cells = [str(k + 1), "0", str(1 + k // 20), words, "0", "0.1", "0.1", f"{AMPERES[state]}", f"{volts:.6f}"]
        lines.append("\t".join([*cells, state, "1", stamp, "25.5"]))
    return head + "\n".join(lines)


def new() -> str:
    lines = ["Rec,Cycle P,Cycle C,Step,Test Time (Hr),Cap. [Ah],Current [A],Voltage [V],Md,DPT Time"]
    for k, (state, volts) in enumerate(zip(STATES, voltages(), strict=True)):
        lines.append(f"{k + 1},0,1,{1 + k // 20},{k / 360:.8f},0.1,{AMPERES[state]},{volts:.6f},{state},3/1/2024")
    return "\n".join(lines)


def voltages() -> np.ndarray:
    amperes = np.array([AMPERES[state] * (-1 if state == "D" else 1) for state in STATES])
    return 3.8 + 0.05 * amperes + 0.3 * np.cumsum(amperes) * 10 / 3600


@pytest.mark.parametrize(
    ("name", "text"), [("a.txt", old(seconds=False)), ("a.001", old(seconds=True)), ("a.csv", new())]
)
def test_what_is_drawn_is_negative_and_what_is_charged_positive(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    record = read_record(path)
    kinds = [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST, StepKind.CC_CHARGE]
    found = [step.kind for step in record.trajectory.steps]
    assert [kind for k, kind in enumerate(found) if k == 0 or kind != found[k - 1]] == kinds
    assert record.trajectory.duration == pytest.approx(1590.0, abs=0.01)
    assert record.trajectory.current.max() == 2.0
    assert record.trajectory.current.min() == -1.0
    assert any("sign of the state of each row" in note for note in record.notes)
    if name != "a.csv":
        assert record.trajectory.temperature[0] == 298.65


@pytest.mark.parametrize(
    ("column", "unit", "scale"),
    [
        ("Current [A]", "Current [mA]", 1e3),
        ("Voltage [V]", "Voltage [mV]", 1e3),
        ("Test Time (Hr)", "TestTime [min]", 60.0),
    ],
)
def test_a_unit_in_square_brackets_counts(tmp_path, column, unit, scale):
    plain, other = tmp_path / "plain.csv", tmp_path / "other.csv"
    plain.write_text(new())
    header, *rows = [line.split(",") for line in new().splitlines()]
    place = header.index(column)
    header[place] = unit
    rows = [[f"{scale * float(cell):.9f}" if k == place else cell for k, cell in enumerate(row)] for row in rows]
    other.write_text("\n".join(map(",".join, [header, *rows])))
    found, wanted = read_record(other).trajectory, read_record(plain).trajectory
    for signal in ("time", "voltage", "current"):
        np.testing.assert_allclose(getattr(found, signal), getattr(wanted, signal), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    "said", [{"time": "Test (Sec)"}, {"current": "Amps"}, {"temperature": "ES"}, {"voltage": "Volts"}]
)
def test_columns_that_are_named_keep_the_sign_of_the_state(tmp_path, said):
    path = tmp_path / "a.001"
    path.write_text(old(seconds=True))
    wanted = read_record(path).trajectory
    record = read_record(path, ReadOptions(columns=said, units={"temperature": "degC"}))
    np.testing.assert_array_equal(record.trajectory.current, wanted.current)
    np.testing.assert_array_equal(record.trajectory.time, wanted.time)
    assert record.trajectory.temperature[0] == 273.15 + (1.0 if "temperature" in said else 25.5)
    assert read_record(path, ReadOptions(where={"Cyc#": "0"})).trajectory.duration == wanted.duration


def test_a_table_without_states_is_not_said_to_have_its_sign_from_them(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(line.rsplit(",", 2)[0] for line in new().splitlines()))
    record = read_record(path, ReadOptions(current_sign="auto"), reader="maccor-text")
    assert not any("state of each row" in note for note in record.notes)


class TestMaccor(ReaderConformance):
    @pytest.fixture
    def name(self) -> str:
        return "maccor-text"

    @pytest.fixture
    def file(self, tmp_path):
        (tmp_path / "cell.txt").write_text(old(seconds=False))
        return tmp_path / "cell.txt"
