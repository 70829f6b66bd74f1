"""Published open-circuit potentials that describe a slow record, and cells that start from them."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.segmentation import segment
from bsa.core.target import CellChange
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.before_search.nearest_potentials import (
    chosen_potentials,
    misfit_of,
    slow_curve,
    slowest_curve,
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
    found = chosen_potentials("nearest", slowest_curve([slow("Ecker2015", 0.005)]))
    assert (found[0].negative, found[0].positive) == ("Ecker2015", "Ecker2015")
    assert found[0].rms_v < 1e-3
    assert found[1].rms_v > 3 * found[0].rms_v
    record = slowest_curve([slow("Ecker2015", 0.005)])
    assert record is not None
    own = misfit_of("Chen2020", record)
    assert own is not None
    assert own > 0.015


def test_halfway_between_charge_and_discharge_is_the_open_circuit() -> None:
    both = slow_curve([slow("Chen2020", 0.03, charge=True)])
    bare = slow_curve([slow("Chen2020", 0.0)])
    assert both is not None
    assert bare is not None
    assert both.polarised == 0
    assert np.max(np.abs(both.voltage - bare.voltage)[5:-5]) < 2e-3


def test_a_slow_charge_and_a_slow_discharge_of_other_charge_are_not_combined() -> None:
    """A slow discharge, a fast one to empty, a slow charge of what that took, a fast one to full."""
    hours, current = np.array([10.0, 1.0, 9.0, 1.5]), np.array([0.3, 2.0, -0.2, -2.0])
    counts = [int(60 * one) for one in hours]
    ends = zip((4.2, 3.4, 3.0, 3.8), (3.5, 2.9, 3.7, 4.2), counts, strict=True)
    voltage = np.concatenate([np.linspace(*of_step) for of_step in ends])
    record = segment(Trajectory(np.arange(len(voltage)) * 60.0, np.repeat(current, counts), voltage))
    found = slow_curve([record])
    assert found is not None
    assert found.polarised == 1
    assert found.charge_ah == pytest.approx(3.0, rel=0.01)
    assert found.voltage[[0, -1]] == pytest.approx([4.2, 3.5], abs=0.01)


def test_a_set_with_other_potentials_shows_the_slow_record() -> None:
    record = slow("Ecker2015", 0.0)
    combined = with_potentials("Chen2020", chosen_potentials("Ecker2015", slowest_curve([record]))[0])
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
    (found,) = chosen_potentials("Mohtat2020/Ecker2015", slowest_curve([slow("Ecker2015", 0.0)]))
    assert str(found) == "Mohtat2020 (negative) and Ecker2015 (positive)"


def test_an_unknown_set_and_a_record_faster_than_1c_are_refused() -> None:
    with pytest.raises(BsaError, match="Mohtat2002") as refused:
        chosen_potentials("Mohtat2002", slowest_curve([slow("Ecker2015", 0.0)]))
    assert "Mohtat2020" in refused.value.hint
    fast = slow("Ecker2015", 0.0)
    fast = fast.changed(time=fast.time / 40.0)
    with pytest.raises(BsaError, match="at 1C or less"):
        chosen_potentials("nearest", slowest_curve([fast]))
    assert slowest_curve([fast]) is None


def test_without_a_slow_record_a_faster_one_tells_and_says_so() -> None:
    record = slow("Ecker2015", 0.06)
    fast = record.changed(time=record.time / 20.0)
    assert slow_curve([fast]) is None
    curve = slowest_curve([fast])
    assert curve is not None
    assert "at about 1C" in curve.words
    assert chosen_potentials("nearest", slowest_curve([fast]))[0].positive == "Ecker2015"
    both = slowest_curve([fast, record])
    assert both is not None
    assert both.words == "the slow record"
