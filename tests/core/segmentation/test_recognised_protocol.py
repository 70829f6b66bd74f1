"""Protocols read off a record's steps."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.segmentation.recognised_protocol import recognised_protocol, with_switches
from bsa.core.trajectory import Step, StepKind, Trajectory


def record(last: StepKind = StepKind.REST) -> Trajectory:
    """Rest, charge, hold, a discharge that time ends, one that the voltage ends, rest; steps begin 10 s late."""
    parts = [
        (StepKind.REST, 100.0, (0.0, 0.0), (3.4, 3.4)),
        (StepKind.CC_CHARGE, 3600.0, (-0.5, -0.5), (3.6, 4.2)),
        (StepKind.CV_HOLD, 1800.0, (-0.5, -0.05), (4.2, 4.2)),
        (StepKind.CC_DISCHARGE, 600.0, (1.0, 1.0), (4.0, 3.9)),
        (StepKind.CC_DISCHARGE, 1200.0, (2.0, 2.0), (3.7, 2.7)),
        (last, 300.0, (0.0, 0.0), (3.0, 3.2)),
    ]
    times, currents, voltages, steps = [], [], [], []
    clock = 0.0
    for place, (kind, seconds, amperes, volts) in enumerate(parts):
        late = 10.0 if place else 0.0
        times.append(clock + np.linspace(late, seconds, 50))
        currents.append(np.linspace(*amperes, 50))
        voltages.append(np.linspace(*volts, 50))
        steps.append(Step(kind, 50 * place, 50 * place + 50, position=place))
        clock += seconds
    return Trajectory(*(np.concatenate(part) for part in (times, currents, voltages)), None, tuple(steps))


def test_the_steps_are_told_in_amperes_and_volts_and_end_by_what_ended_them() -> None:
    assert recognised_protocol(with_switches(record()), "r") == (
        (
            "Rest for 100 seconds",
            "Charge at 0.5 A until 4.200 V",
            "Hold at 4.200 V until 0.05 A",
            "Discharge at 1 A for 600 seconds",
            "Discharge at 2 A until 2.700 V",
            "Rest for 300 seconds",
        ),
    )


def test_steps_meet_and_no_charge_is_lost_at_the_switches() -> None:
    met = with_switches(record())
    assert [met.time[step.start] for step in met.steps[1:]] == [met.time[step.stop - 1] for step in met.steps[:-1]]
    assert len(met) == len(record()) + 5
    discharged = met.discharge_capacity[met.steps[4].stop - 1] - met.discharge_capacity[met.steps[3].start]
    assert discharged == pytest.approx((600.0 * 1.0 + 1200.0 * 2.0) / 3600.0)
    assert len(with_switches(met)) == len(met)
    assert list(np.flatnonzero(met.inserted)) == [step.start for step in met.steps[1:]]


def test_a_rest_that_is_written_seldom_goes_on_until_the_load_begins() -> None:
    time = np.array([0.0, 600.0, 1200.0, *(1800.0 + np.arange(100.0)), 2500.0])
    current = np.array([0.0, 0.0, 0.0, *np.full(100, 2.0), 0.0])
    steps = (Step(StepKind.REST, 0, 3), Step(StepKind.CC_DISCHARGE, 3, 103), Step(StepKind.REST, 103, 104))
    met = with_switches(Trajectory(time, current, np.linspace(4.1, 3.9, 104), steps=steps))
    assert [met.time[step.start] for step in met.steps] == [0.0, 1798.5, 1899.0]
    assert met.discharge_capacity[-1] == pytest.approx(2.0 * 100.5 / 3600.0)
    assert list(np.flatnonzero(met.inserted)) == [3, 4, 105]
    assert list(met.voltage[met.inserted]) == [met.voltage[2], met.voltage[5], met.voltage[-1]]


def test_a_drive_cycle_is_no_protocol() -> None:
    with pytest.raises(BsaError, match="which no protocol tells") as caught:
        recognised_protocol(record(StepKind.DRIVE), "US06")
    assert "--as-protocol" in caught.value.hint
