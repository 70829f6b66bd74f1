"""Open-circuit curves by slow charges and discharges, and after long rests."""

import numpy as np
import pytest
from bsa.core.reading.open_circuit import open_circuit_curve, rested_places, slow_curve, steady_stretches
from bsa.core.segmentation import segment
from bsa.core.trajectory import StepKind, Trajectory

RESISTANCE = 0.05


def driven(*steps, interval=10.0, full_ah=2.0):
    """A record of (hours, current A) steps of a cell whose open-circuit voltage falls from 4.2 to 3 V."""
    current = np.concatenate([np.full(round(3600.0 * hours / interval), amperes) for hours, amperes in steps])
    time = np.arange(len(current)) * interval
    drawn = np.concatenate([[0.0], np.cumsum(current[1:])]) * interval / 3600.0
    return segment(Trajectory(time, current, 4.2 - 1.2 * drawn / full_ah - RESISTANCE * current))


def pulse_test(count, rest_h=0.5, current=1.0):
    """A rest, and so many discharges that share the charge of the cell, each with a rest behind it."""
    return driven((rest_h, 0.0), *[(2.0 / count / current, current), (rest_h, 0.0)] * count)


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


@pytest.mark.parametrize("count", [10, 120])
def test_rests_of_a_pulse_test_are_a_curve(count):
    record = pulse_test(count)
    curve = open_circuit_curve([record])
    assert curve.words == f"the voltages at the end of {count + 1} rests"
    assert curve.polarised == 0
    assert curve.voltage == pytest.approx(4.2 - 1.2 * curve.share, abs=0.02)
    assert curve.charge_ah == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(
    "record",
    [
        pulse_test(5),  # too few
        pulse_test(10, rest_h=0.1),  # too short
        driven(*[(1.0, 2.0), (0.5, 0.0), (1.0, -2.0), (0.5, 0.0)] * 6),  # at both ends of each cycle
        driven((0.5, 0.0), *[(0.1, 1.0), (0.5, 0.0)] * 10, (0.5, 2.0), (0.5, 0.0)),  # a half of the charge has none
    ],
)
def test_other_rests_are_no_curve(record):
    assert not len(rested_places(record))


def test_rests_behind_charges_are_not_mixed_with_those_behind_discharges():
    up_and_down = driven(
        *[(0.5, 0.0), *[(0.2, 1.0), (0.5, 0.0)] * 10],
        *[(0.2, -1.0), (0.5, 0.0)] * 9,
    )
    places = rested_places(up_and_down)
    assert len(places) == 11
    assert np.all(np.diff(places) > 0)


def test_a_slow_record_is_taken_before_rests_and_rests_before_a_faster_record():
    fast = driven((1.9, 1.0))
    assert "none is slow" in open_circuit_curve([fast]).words
    assert "rests" in open_circuit_curve([fast, pulse_test(10)]).words
    assert open_circuit_curve([fast, pulse_test(10), driven((9.9, 0.2))]).words == "the slow record"


def test_short_rests_interrupt_a_slow_charge_and_do_not_end_it():
    interrupted = driven((0.2, 0.0), *[(1.0 / 12.0, 0.2), (30.0 / 3600.0, 0.0)] * 119, interval=5.0)
    (found,) = steady_stretches(interrupted)
    assert found.kind is StepKind.CC_DISCHARGE
    assert found.hours == pytest.approx(119 / 12, rel=0.02)
    assert np.all(interrupted.current[found.places] > 0.0)
    assert slow_curve([interrupted]).charge_ah == pytest.approx(119 / 60, rel=0.02)


def test_another_current_or_a_long_rest_ends_it():
    assert len(list(steady_stretches(driven((1.0, 0.2), (0.01, 0.0), (1.0, 0.3))))) == 2
    assert len(list(steady_stretches(driven((1.0, 0.2), (0.1, 0.0), (1.0, 0.2))))) == 2
