"""What is said of a record's charge, and what is taken off its current."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.reading.charge import unreturned_charge
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions


def there_and_back(offset_a: float) -> Samples:
    """A discharge and a charge of 20 h between rests, as an instrument with an offset writes them; charge positive."""
    time = np.arange(0.0, 44 * 3600.0, 60.0)
    hours = time / 3600.0
    true = np.select([(hours >= 1) & (hours < 21), (hours >= 22) & (hours < 42)], [-0.1, 0.1], 0.0)
    drawn = -np.cumsum(true) * 60.0 / 3600.0
    return Samples("a", time, 4.15 - 0.5 * drawn, np.where(true == 0.0, 0.0, true + offset_a))


def test_a_charge_that_does_not_come_back_names_the_offset_that_takes_it_off() -> None:
    (said,) = [note for note in to_record(there_and_back(-0.005), ReadOptions()).notes if "offset" in note]
    assert "more is drawn than charged" in said
    assert "--current-offset -0.005" in said
    mended = to_record(there_and_back(-0.005), ReadOptions(current_offset_a=-0.005))
    assert mended.trajectory.discharge_capacity[-1] == pytest.approx(0.0, abs=1e-9)
    assert mended.trajectory.current[0] == 0.0
    assert any("are taken off the current" in note for note in mended.notes)


def test_the_charge_between_two_rest_voltages_is_no_part_of_the_offset() -> None:
    whole = there_and_back(-0.005)
    emptier = replace(whole, voltage=np.where(whole.time >= 42 * 3600.0, whole.voltage - 0.02, whole.voltage))
    found, lower = (unreturned_charge(to_record(one, ReadOptions()).trajectory) for one in (whole, emptier))
    assert found is not None
    assert lower is not None
    assert found.offset_a == pytest.approx(0.005, rel=0.01)
    # Of 0.5 V/(A.h) 20 mV are 0.04 A.h.
    assert lower.between_ah == pytest.approx(0.04, rel=0.1)
    assert lower.offset_a == pytest.approx((lower.net_ah - lower.between_ah) / 40.0, rel=0.01)


def test_two_rest_voltages_on_a_flat_curve_tell_no_offset() -> None:
    whole = there_and_back(-0.005)
    drawn = (4.15 - whole.voltage) / 0.5
    for slope in (0.015, 0.001):
        flat = replace(whole, voltage=3.35 - slope * drawn - 0.02 * (whole.time >= 42 * 3600.0))
        assert unreturned_charge(to_record(flat, ReadOptions()).trajectory) is None


def test_a_rest_ends_where_the_record_is_silent() -> None:
    whole = there_and_back(-0.005)
    late = replace(
        whole,
        time=np.append(whole.time, whole.time[-1] + 50_000.0),
        voltage=np.append(whole.voltage, whole.voltage[-1] - 0.1),
        current=np.append(whole.current, 0.0),
        rows=np.append(whole.rows, whole.rows[-1] + 1),
        inserted=np.append(whole.inserted, False),
    )
    (said,) = [note for note in to_record(late, ReadOptions()).notes if "offset" in note]
    assert f"ends so at {whole.voltage[-1]:.3f} V" in said


def test_a_sound_record_and_one_that_ends_elsewhere_say_nothing_of_an_offset() -> None:
    assert not any("offset" in note for note in to_record(there_and_back(0.0), ReadOptions()).notes)
    whole = there_and_back(-0.005)
    half = whole.kept(whole.time < 21.9 * 3600.0)
    assert not any("offset" in note for note in to_record(half, ReadOptions()).notes)


def test_a_pulse_one_way_says_nothing_of_an_offset() -> None:
    time = np.arange(0.0, 4000.0, 1.0)
    current = np.where((time >= 600.0) & (time < 610.0), -5.0, 0.0)
    pulse = Samples("a", time, 3.7 + 0.03 * current, current)
    assert not any("offset" in note for note in to_record(pulse, ReadOptions()).notes)
