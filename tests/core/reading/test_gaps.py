"""Silences in which an unknown charge may have passed, and holds that are written when their current has changed."""

import numpy as np
import pytest
from bsa.core.reading.gaps import gaps_in, with_gaps_noted
from bsa.core.reading.samples import Samples


def held(pause_s: float, before: float, after: float, after_v: float = 4.2) -> Samples:
    """A charge of 1.1 A.h at 0.55 A, and a hold at 4.2 V that is written twice, with a pause between."""
    time = np.concatenate([np.arange(0.0, 7200.0, 30.0), [7230.0, 7230.0 + pause_s, 7260.0 + pause_s]])
    voltage = np.concatenate([np.linspace(3.5, 4.2, 240), [4.2, after_v, after_v]])
    return Samples("a.csv", time, voltage, np.concatenate([np.full(240, 0.55), [before, after, after]]))


def test_a_hold_that_is_written_when_its_current_has_fallen_is_not_silent() -> None:
    read = held(1130.0, 0.1, 0.05)
    assert len(gaps_in(read)) == 0
    assert with_gaps_noted(read) is read


@pytest.mark.parametrize(
    "read",
    [
        pytest.param(held(1130.0, 0.1, 0.05, 4.15), id="another voltage"),
        pytest.param(held(1130.0, 0.1, 0.2), id="a larger current, as after a rest"),
        pytest.param(held(1130.0, 0.1, 0.0999), id="the same current, as after a pause"),
        pytest.param(held(1130.0, 0.1, -0.05), id="the other way"),
        pytest.param(held(1130.0, 0.1, 0.0), id="the end of a load"),
        pytest.param(held(3600.0, 0.1, 0.05), id="between the currents lie 4 % of the charge"),
    ],
)
def test_what_leaves_the_charge_open_is_a_gap(read: Samples) -> None:
    assert gaps_in(read).tolist() == [240]
    assert "1 gap without samples" in with_gaps_noted(read).notes[0]


def test_a_record_of_one_sample_has_no_gap() -> None:
    assert len(gaps_in(held(30.0, 0.1, 0.05).kept(np.array([0])))) == 0


def test_a_gap_of_many_hours_is_told_without_a_power_of_ten():
    time = np.append(9.0 * np.arange(50), 9.0 * 49 + 48_970.0 + 9.0 * np.arange(50))
    found = with_gaps_noted(Samples("a.csv", time, np.full(100, 4.0), np.full(100, -2.0)))
    assert any("the longest of 48970 s after row " in note for note in found.notes)
