import numpy as np
import pytest
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.tasks.record_start import jump_resistances, open_circuit_start, starts_at_rest, with_room_for


def test_a_resistance_is_read_off_prompt_jumps_away_from_the_empty_end() -> None:
    time = np.array([0.0, 60.0, 61.0, 3600.0, 3601.0, 4200.0, 4260.0, 4300.0])
    current = np.array([0.0, 0.0, 2.0, 2.0, 0.0, 0.0, -1.0, -1.0])
    voltage = np.array([4.1, 4.1, 4.0, 2.5, 3.3, 3.4, 3.6, 4.1])
    steps = tuple(Step(StepKind.REST, start, start + 2, position=start // 2) for start in (0, 2, 4, 6))
    record = Trajectory(time, current, voltage, None, steps)
    # 50 mOhm when the discharge begins; 400 from empty, and 200 a minute late.
    assert jump_resistances(record) == pytest.approx([0.05])


def test_a_record_starts_at_rest_though_its_last_resting_sample_has_the_voltage_under_load() -> None:
    time = np.array([0.0, 0.1, 0.2, 10.0])
    record = Trajectory(
        time,
        np.array([0.0, 0.0, 7.5, 7.5]),
        np.array([3.701, 3.467, 3.465, 3.43]),
        steps=(Step(StepKind.REST, 0, 2), Step(StepKind.PULSE, 2, 4, position=1)),
    )
    voltage, words = open_circuit_start(record)
    assert voltage == 3.701
    assert words == "starts at 3.701 V (its last sample at rest has the voltage under load already)"
    assert jump_resistances(record) == pytest.approx([0.236 / 7.5])


def test_a_discharge_that_begins_under_load_starts_with_the_charge_that_it_gives() -> None:
    time = np.linspace(0.0, 3600.0, 61)
    current = np.full(61, 2.0)
    voltage = np.linspace(3.6, 2.6, 61)
    record = Trajectory(time, current, voltage, None, (Step(StepKind.CC_DISCHARGE, 0, 61),))
    assert with_room_for(record, 0.6, capacity_ah=2.5) == pytest.approx(0.8)
    assert with_room_for(record, 0.9, capacity_ah=2.5) == pytest.approx(0.9)
    assert with_room_for(record, 0.6, capacity_ah=1.9) == 1.0
    charge = record.changed(current=-current)
    assert with_room_for(charge, 0.6, capacity_ah=2.5) == pytest.approx(0.2)
    rested = record.changed(current=np.r_[0.0, current[1:]])
    assert with_room_for(rested, 0.6, capacity_ah=2.5) == 0.6


def test_a_first_sample_from_before_the_load_is_told_by_a_record_of_another_current() -> None:
    time = np.array([0.0, 1.0, 2.0, 3600.0])
    steps = (Step(StepKind.CC_DISCHARGE, 0, 4),)
    slow = Trajectory(time, np.full(4, 0.5), np.array([4.1810, 4.1700, 4.1690, 3.0]), None, steps)
    fast = Trajectory(time, np.full(4, 2.0), np.array([4.1811, 4.1350, 4.1310, 3.0]), None, steps)
    assert not starts_at_rest(slow)
    assert starts_at_rest(slow, [fast])
    assert starts_at_rest(fast, [slow])
    assert open_circuit_start(fast, [slow]) == (4.1811, "starts at 4.181 V")
    # First samples under load differ by as much as the currents do.
    loaded = fast.changed(voltage=np.array([4.1350, 4.1310, 4.1290, 3.0]))
    assert not starts_at_rest(loaded, [slow])
    # Two records of one current begin alike, whenever their first samples were taken.
    assert not starts_at_rest(loaded, [loaded.changed(voltage=loaded.voltage + 1e-3)])


def test_what_is_assumed_of_a_voltage_under_load_is_told_as_an_assumption() -> None:
    time = np.array([0.0, 60.0, 120.0, 121.0, 180.0])
    current = np.array([-2.0, -2.0, -2.0, -1.0, -1.0])
    steps = (Step(StepKind.CC_CHARGE, 0, 3), Step(StepKind.CC_CHARGE, 3, 5, position=1))
    voltage = np.array([3.6, 3.62, 3.65, 3.6, 3.61])
    whole = Trajectory(time, current, voltage, None, steps)
    first, words = open_circuit_start(whole)
    assert first == pytest.approx(3.5)
    assert words.startswith(
        "begins under load (3.600 V at 2 A of charge): with 50 mohm, which its current steps show, "
    )
    alone = whole.slice(0, 3)
    _, words = open_circuit_start(alone)
    assert "this voltage is assumed to be the open-circuit voltage, which is lower (give --initial-soc" in words
    elsewhere, words = open_circuit_start(alone, [alone, whole])
    assert elsewhere == pytest.approx(3.5)
    assert "with 50 mohm, which the other records' current steps show, " in words
    assert open_circuit_start(alone, [alone]) == open_circuit_start(alone)
