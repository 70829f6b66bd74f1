"""Sizes of a current become signed where the state of each row says charge or discharge."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from bsa.plugins.readers.state_sign import with_signs
from hypothesis import given
from hypothesis import strategies as st

SIZES = np.repeat([0.0, 2.0, 0.0, 1.0], [20, 60, 20, 60])
TRUE = np.repeat([0.0, -2.0, 0.0, 1.0], [20, 60, 20, 60])
VOLTAGE = 3.8 + 0.05 * TRUE + 0.3 * np.cumsum(TRUE) * 10 / 3600

WORDS = {
    "LAND": ("State", ["Rest", "D_CC", "Rest", "C_CC"]),
    "LAND, newer": ("Mode", ["Rest", "CC_DChg", "Rest", "CC_Chg"]),
    "Bitrode": ("Mode", ["REST", "DCHG", "REST", "CHRG"]),
    "Neware": ("Step Type", ["Rest", "CC DChg", "Rest", "CCCV Chg"]),
    "Neware, Chinese": ("工步类型", ["搁置", "恒流放电", "搁置", "恒流充电"]),
    "German": ("Status", ["Pause", "Entladen", "Pause", "Laden"]),
    "words": ("Status", ["idle", "Discharging", "idle", "Charging"]),
}


def table(name, states, current=SIZES):
    rows = zip(10.0 * np.arange(160), current, VOLTAGE, np.repeat(states, [20, 60, 20, 60]), strict=True)
    return "\n".join([f"Time [s],Current [A],Voltage [V],{name}", *(f"{t},{i},{v:.6f},{s}" for t, i, v, s in rows)])


@pytest.mark.parametrize("maker", WORDS)
def test_sizes_get_the_sign_of_the_words_of_each_maker(tmp_path, maker):
    (tmp_path / "a.csv").write_text(table(*WORDS[maker]), encoding="utf-8")
    record = read_record(tmp_path / "a.csv")
    np.testing.assert_allclose(record.trajectory.current, -TRUE)
    assert [step.kind for step in record.trajectory.steps] == [
        *(StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST, StepKind.CC_CHARGE)
    ]
    assert any("sign of the state of each row" in note for note in record.notes)


def test_a_current_with_signs_keeps_them(tmp_path):
    (tmp_path / "a.csv").write_text(table("State", ["Rest", "Charge", "Rest", "Discharge"], TRUE))
    record = read_record(tmp_path / "a.csv")
    np.testing.assert_allclose(record.trajectory.current, -TRUE)
    assert not any("state of each row" in note for note in record.notes)


def test_what_a_person_says_of_the_sign_holds_too(tmp_path):
    (tmp_path / "a.csv").write_text(table("State", ["Rest", "Discharge", "Rest", "Charge"]))
    for said in ("discharge-positive", "auto"):
        record = read_record(tmp_path / "a.csv", ReadOptions(current_sign=said))
        np.testing.assert_allclose(record.trajectory.current, -TRUE)


def test_states_that_are_swapped_are_refused_by_the_voltage(tmp_path):
    (tmp_path / "a.csv").write_text(table("State", ["Rest", "Charge", "Rest", "Discharge"]))
    with pytest.raises(BsaError, match="charge-positive"):
        read_record(tmp_path / "a.csv")


def test_states_in_numbers_tell_no_sign(tmp_path):
    (tmp_path / "a.csv").write_text(table("State", ["1", "2", "1", "3"]))
    with pytest.raises(BsaError, match="charge-positive"):
        read_record(tmp_path / "a.csv")


@given(st.lists(st.tuples(st.sampled_from(["D", "C", "R", "CV", "", "Dis"]), st.floats(0.0, 10.0)), min_size=1))
def test_sizes_stay_and_a_state_that_says_nothing_goes_on(rows):
    states, sizes = [state for state, _ in rows], np.array([size for _, size in rows])
    signed = with_signs(sizes, states, discharge_positive=False)
    if signed is None:
        assert not {"D", "Dis"} & set(states)
        return
    np.testing.assert_array_equal(np.abs(signed), sizes)
    negative = False
    for state, value in zip(states, signed, strict=True):
        negative = state in ("D", "Dis") or (negative and state != "C")
        assert value <= 0.0 if negative else value >= 0.0


def test_a_row_without_a_current_does_not_keep_the_others_from_their_sign(tmp_path):
    current = np.where(np.arange(160) == 30, np.nan, SIZES)
    (tmp_path / "a.csv").write_text(table(*WORDS["words"], current))
    found = read_record(tmp_path / "a.csv").trajectory
    np.testing.assert_allclose(found.current, -np.delete(TRUE, 30))
