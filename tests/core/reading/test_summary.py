"""What a record says is what was put into it: charges, resistances, slow curves and what is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.reading.summary import summary
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory

OHM = 0.05


def record(current: np.ndarray, interval: float = 1.0, warm: bool = False, early: bool = False) -> Record:
    """A 2 Ah cell of one resistance, and a voltage that falls with its charge."""
    time = np.arange(len(current)) * interval
    drawn = np.cumsum(current) * interval / 3600
    drop = OHM * (np.concatenate([current[1:], current[-1:]]) if early else current)
    temperature = 298.15 + 0.5 * drawn if warm else None
    return Record("a", segment(Trajectory(time, current, 4.1 - 0.4 * drawn - drop, temperature)), ("noted",))


def test_steps_and_cycles_carry_the_charge_that_was_drawn():
    once = np.repeat([0.0, 2.0, 0.0, -2.0, 0.0], [60, 1800, 600, 1800, 600])
    found = summary(record(np.tile(once, 3), warm=True))
    assert [row.kind for row in found.steps[:4]] == ["rest", "CC discharge", "rest", "CC charge"]
    assert [row.charge_ah for row in found.steps[:4]] == pytest.approx([0.0, 1.0, 0.0, -1.0], abs=1e-3)
    assert [row.discharged_ah for row in found.cycles] == pytest.approx([1.0] * 3, abs=1e-3)
    assert [row.charged_ah for row in found.cycles] == pytest.approx([1.0] * 3, abs=1e-3)
    assert found.cycles[0].warmest_c == pytest.approx(25.5, abs=0.01)
    assert found.problems == ("noted",)


@pytest.mark.parametrize("early", [False, True])
def test_a_resistance_is_found_even_where_the_voltage_was_logged_before_the_current(early):
    current = np.repeat([0.0, 4.0, 0.0], [60, 10, 60])
    found = summary(record(current, early=early)).resistances
    assert [row.ohm for row in found] == pytest.approx([OHM, OHM], rel=0.05)
    assert [row.current_change_a for row in found] == [4.0, -4.0]
    assert all(row.after_s <= 2.0 for row in found)


def test_a_voltage_that_was_logged_before_its_current_is_said():
    current = np.repeat([0.0, 4.0, 0.0], [60, 10, 60])
    said = " ".join(summary(record(current, early=True)).problems)
    assert "are not of one moment where the current switches (2 samples, the first at 59 s)" in said
    assert "of one moment" not in " ".join(summary(record(current)).problems)


def test_a_voltage_that_falls_steeply_before_a_discharge_ends_is_none_of_before_its_current():
    known = record(np.repeat([0.0, 4.0, 0.0], [60, 10, 60]))
    voltage = known.trajectory.voltage.copy()
    voltage[69] -= 0.15  # the last sample under load
    steep = replace(known, trajectory=known.trajectory.changed(voltage=voltage))
    assert summary(steep).resistances[-1].voltage == voltage[69]


@pytest.mark.parametrize(("interval", "ohms"), [(1.0, [OHM, OHM]), (20.0, [OHM])])
def test_a_voltage_that_has_moved_by_its_last_digit_shows_no_resistance_of_its_own(interval, ohms):
    known = record(np.repeat([0.0, 4.0, 0.0], [60, 10, 60]), interval)
    voltage = np.round(known.trajectory.voltage, 4)
    voltage[70] = voltage[69] + 1e-4  # the current is off already
    late = replace(known, trajectory=known.trajectory.changed(voltage=voltage))
    assert [row.ohm for row in summary(late).resistances] == pytest.approx(ohms, rel=0.15)


def test_a_slow_step_is_an_open_circuit_curve_and_a_quick_one_is_none():
    slow = summary(record(np.full(1200, 0.1), interval=60.0))
    assert len(slow.slow) == 1
    assert slow.slow[0].hours == pytest.approx(20.0, rel=0.01)
    assert slow.slow[0].charge_ah == pytest.approx(2.0, rel=0.01)
    assert not summary(record(np.full(1200, 2.0), interval=3.0)).slow


def test_the_current_of_a_hold_is_its_mean_over_time():
    # A cycler writes the beginning of a hold, where the current falls, more often than the rest.
    time = np.concatenate([np.arange(0.0, 3600.0, 30.0), 3600.0 + 60.0 * np.linspace(0.0, 1.0, 100) ** 2 * 60.0])
    current = np.concatenate([np.full(120, -1.0), -np.exp(-(time[120:] - 3600.0) / 900.0)])
    voltage = np.concatenate([np.linspace(3.5, 4.2, 120), np.full(100, 4.2)])
    hold = summary(Record("a", segment(Trajectory(time, current, voltage)))).steps[-1]
    assert hold.kind == "CV hold"
    assert hold.current_a == pytest.approx(3600.0 * hold.charge_ah / hold.duration_s)
    assert abs(hold.current_a) < 0.8 * abs(np.median(current[120:]))


def test_what_is_missing_is_said():
    said = " ".join(summary(record(np.full(100, 2.0))).problems)
    assert "starts under load (-2 A, positive on charge)" in said
    assert "there is no temperature of the cell" in said
    # The offset of an ammeter is no load.
    assert "under load" not in " ".join(summary(record(np.append(0.06, np.full(99, 2.0)))).problems)


def test_a_resistance_is_that_between_two_samples_that_were_taken():
    known = record(np.repeat([0.0, 4.0, 0.0], [60, 10, 60]))
    places = np.insert(np.arange(len(known.trajectory)), 60, 60)
    late = known.trajectory.picked(places, ())
    late = replace(late, time=np.insert(known.trajectory.time, 60, 59.0), inserted=np.arange(len(late)) == 60)
    first, _ = summary(replace(known, trajectory=segment(late))).resistances
    assert first.ohm == pytest.approx(OHM, rel=0.05)
    assert first.after_s == pytest.approx(1.0)


def coarse(interval: float) -> Record:
    """Rest, half an hour of 2 A and a rest, each step written at its end and an interval after its beginning."""
    ends = np.arange(interval, 1800.0 + interval, interval)
    time = np.concatenate([[0.0], ends, 1800.0 + ends, 3600.0 + ends])
    current = np.repeat([0.0, 2.0, 0.0], [len(ends) + 1, len(ends), len(ends)])
    voltage = np.concatenate([np.full(len(ends) + 1, 4.1), np.linspace(4.0, 3.5, len(ends)), np.full(len(ends), 3.7)])
    return Record("a", segment(Trajectory(time, current, voltage)))


def test_no_charge_flows_between_the_last_sample_of_a_load_and_the_first_of_a_rest():
    found = summary(coarse(60.0))
    assert [row.charge_ah for row in found.steps] == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    assert [row.discharged_ah for row in found.cycles] == pytest.approx([1.0])


def test_a_step_begins_where_the_one_before_ended():
    steps = summary(coarse(60.0)).steps
    assert [(row.start_s, row.duration_s) for row in steps] == [(0.0, 1800.0), (1800.0, 1800.0), (3600.0, 1800.0)]


def test_a_charge_that_depends_on_when_the_current_was_switched_is_told():
    said = " ".join(summary(coarse(60.0)).problems)
    assert "switched between samples far apart (places: 2;" in said
    assert "another by up to 0.033 A.h (3.3 % of the largest)" in said
    assert "far apart" not in " ".join(summary(coarse(5.0)).problems)


def test_a_relaxation_that_begins_with_the_last_sample_of_the_charge_has_no_largest_charge() -> None:
    found = summary(record(np.concatenate([[-1.5], np.zeros(120)]), interval=30.0))
    (problem,) = [one for one in found.problems if "switched between samples" in one]
    assert problem.endswith("by up to 0.013 A.h.")


def test_rests_alone_show_no_resistance() -> None:
    rests = record(np.zeros(120))
    steps = tuple(replace(rests.trajectory.steps[0], start=a, stop=a + 60) for a in (0, 60))
    assert summary(replace(rests, trajectory=rests.trajectory.picked(slice(None), steps))).resistances == ()
