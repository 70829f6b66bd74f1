"""Published open-circuit potentials that describe a measured curve, and cells that start from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.open_circuit import open_circuit_curve, slow_curve
from bsa.core.segmentation import segment
from bsa.core.target import CellChange
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.before_search.nearest_potentials import (
    chosen_potentials,
    own_potentials,
    with_potentials,
)
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.cells.state_of_charge import InitialState, equilibrium_capacity_ah

FARADAY, HOURS, CAPACITY_AH = 96485.332, 20.0, 5.0


def slow(parameter_set: str, polarisation_v: float, charge: bool = False) -> Trajectory:
    """A discharge at C/20 of a set's cell at equilibrium, and a charge behind it; polarised alike."""
    values = load(parameter_set)
    state = InitialState(values)
    area = values["Electrode width [m]"] * values["Electrode height [m]"]
    capacity = equilibrium_capacity_ah(parameter_set, {})
    time = np.linspace(0.0, 3600.0 * HOURS, 401)
    drawn = np.linspace(0.0, 0.98 * capacity, 401)
    voltage = state.voltages(CellChange(), 0.99, drawn * 3600.0 / FARADAY / area)
    current = np.full(401, drawn[-1] / HOURS)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 401),)
    if not charge:
        return Trajectory(time, current, voltage - polarisation_v, None, steps)
    return Trajectory(
        np.concatenate([time, time[-1] + 1.0 + time]),
        np.concatenate([current, -current]),
        np.concatenate([voltage - polarisation_v, voltage[::-1] + polarisation_v]),
        None,
        (*steps, Step(StepKind.CC_CHARGE, 401, 802)),
    )


@pytest.mark.slow
def test_the_potentials_of_the_set_that_made_the_record_are_nearest() -> None:
    found = chosen_potentials("nearest", open_circuit_curve([slow("Ecker2015", 0.005)]))
    assert found[0].sets == {"Negative": "Ecker2015", "Positive": "Ecker2015"}
    assert found[0].rms_v < 1e-3
    assert found[1].rms_v > 3 * found[0].rms_v
    record = open_circuit_curve([slow("Ecker2015", 0.005)])
    assert record is not None
    own = own_potentials("Chen2020", record)
    assert own is not None
    assert own.rms_v > 0.015


@pytest.mark.slow
def test_a_slow_discharge_is_not_taken_for_that_of_a_strongly_polarised_cell() -> None:
    """What lies 0.15 V lower at C/20 has other potentials: with the same ones the electrodes would be too large."""
    record = open_circuit_curve([slow("Ecker2015", 0.15)])
    assert record is not None
    own = own_potentials("Ecker2015", record)
    assert own is not None
    assert own.rms_v > 0.01
    faster = own_potentials("Ecker2015", replace(record, hours=1.0))
    assert faster is not None
    assert faster.rms_v < 1e-3


def test_halfway_between_charge_and_discharge_is_the_open_circuit() -> None:
    both = slow_curve([slow("Chen2020", 0.03, charge=True)])
    bare = slow_curve([slow("Chen2020", 0.0)])
    assert both is not None
    assert bare is not None
    assert both.polarised == 0
    assert np.max(np.abs(both.voltage - bare.voltage)[5:-5]) < 2e-3


def test_a_set_with_other_potentials_shows_the_slow_record() -> None:
    record = slow("Ecker2015", 0.0)
    combined = with_potentials("Chen2020", chosen_potentials("Ecker2015", open_circuit_curve([record]))[0])
    values = load(combined)
    state = InitialState(values)
    scale = np.ptp(record.discharge_capacity) / equilibrium_capacity_ah(combined, {})
    area = values["Electrode width [m]"] * values["Electrode height [m]"] * scale / 0.98
    drawn = record.discharge_capacity * 3600.0 / FARADAY / area
    start = state.soc_at(float(record.voltage[0]))
    shown = state.voltages(CellChange(), start, drawn)
    assert np.sqrt(np.mean((shown - record.voltage)[:-20] ** 2)) < 0.02
    assert "Chen2020 with the potentials of Ecker2015" in str(combined)
    assert values["Negative electrode thickness [m]"] == load("Chen2020")["Negative electrode thickness [m]"]


def test_the_electrodes_can_be_of_two_sets() -> None:
    (found,) = chosen_potentials("Mohtat2020/Ecker2015", open_circuit_curve([slow("Ecker2015", 0.0)]))
    assert str(found) == "Mohtat2020 (negative) and Ecker2015 (positive)"


def test_an_unknown_set_and_a_record_faster_than_1c_are_refused() -> None:
    with pytest.raises(BsaError, match="Mohtat2002") as refused:
        chosen_potentials("Mohtat2002", open_circuit_curve([slow("Ecker2015", 0.0)]))
    assert "Mohtat2020" in refused.value.hint
    with pytest.raises(BsaError, match='"Chen2020/Ecker2015" is no set'):
        chosen_potentials("Mohtat2020/Chen2020/Ecker2015", open_circuit_curve([slow("Ecker2015", 0.0)]))
    fast = slow("Ecker2015", 0.0)
    fast = fast.changed(time=fast.time / 40.0)
    with pytest.raises(BsaError, match="over half of its charge"):
        chosen_potentials("nearest", open_circuit_curve([fast]))
    assert open_circuit_curve([fast]) is None


@pytest.mark.slow
def test_without_a_slow_record_a_faster_one_tells_and_says_so() -> None:
    record = slow("Ecker2015", 0.06)
    fast = record.changed(time=record.time / 20.0)
    assert slow_curve([fast]) is None
    curve = open_circuit_curve([fast])
    assert curve is not None
    assert "at about 1C" in curve.words
    assert chosen_potentials("nearest", open_circuit_curve([fast]))[0].sets["Positive"] == "Ecker2015"
    both = open_circuit_curve([fast, record])
    assert both is not None
    assert both.words == "the slow record"


@pytest.mark.slow
def test_rests_of_a_pulse_test_tell_the_potentials() -> None:
    """Pulses of C/2 with rests of half an hour, at the open-circuit voltages of a set's cell."""
    record = slow("Ecker2015", 0.0)
    drawn, voltage = np.interp(np.linspace(0.0, 1.0, 12), np.linspace(0.0, 1.0, 401), record.discharge_capacity), []
    voltage = np.interp(drawn, record.discharge_capacity, record.voltage)
    pulse_s = 3600.0 * float(drawn[1] - drawn[0]) / (record.current[0] * HOURS / 2.0)
    time, current, shown = [np.arange(0.0, 1801.0, 60.0)], [np.zeros(31)], [np.full(31, voltage[0])]
    for number in range(1, 12):
        time.append(time[-1][-1] + np.linspace(1.0, pulse_s + 1.0, 40))
        current.append(np.full(40, record.current[0] * HOURS / 2.0))
        shown.append(np.linspace(voltage[number - 1], voltage[number], 40) - 0.15)
        time.append(time[-1][-1] + 1.0 + np.arange(0.0, 1801.0, 60.0))
        current.append(np.zeros(31))
        shown.append(voltage[number] - 0.05 * np.exp(-np.arange(31.0)))
    pulses = segment(Trajectory(np.concatenate(time), np.concatenate(current), np.concatenate(shown)))
    curve = open_circuit_curve([pulses])
    assert curve is not None
    assert curve.words == "the voltages at the end of 12 rests"
    found = chosen_potentials("nearest", curve)[0]
    assert (found.sets["Positive"], found.rms_v < 2e-3) == ("Ecker2015", True)


def test_a_slow_record_corrects_the_potentials_of_another_maker() -> None:
    record = slow("Mohtat2020", 0.0)
    curve = open_circuit_curve([record])
    assert curve is not None
    own = own_potentials("Ecker2015", curve)
    assert own is not None
    better = own.corrected_by(curve)
    assert better.rms_v < 0.4 * own.rms_v
    left = []
    for found in (own, better):
        combined = with_potentials("Ecker2015", found)
        values = load(combined)
        state = InitialState(values)
        scale = np.ptp(record.discharge_capacity) / equilibrium_capacity_ah(combined, {})
        area = values["Electrode width [m]"] * values["Electrode height [m]"] * scale / 0.98
        shown = state.voltages(
            CellChange(), state.soc_at(float(record.voltage[0])), record.discharge_capacity * 3600.0 / FARADAY / area
        )
        left.append(float(np.sqrt(np.mean((shown - record.voltage)[:-20] ** 2))))
    assert left[1] < 0.7 * left[0]
    assert "Ecker2015 with corrected potentials" in str(combined)


def test_a_record_that_is_not_slow_corrects_nothing() -> None:
    curve = open_circuit_curve([slow("Mohtat2020", 0.0)])
    assert curve is not None
    own = own_potentials("Ecker2015", curve)
    assert own is not None
    assert own.corrected_by(replace(curve, hours=1.0)) is own
