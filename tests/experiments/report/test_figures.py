"""Residuals as figures draw them."""

from __future__ import annotations

import numpy as np
from bsa.core.cell import VOLTAGE
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.report.figures import _Curve


def test_no_residual_is_drawn_between_a_switch_and_the_first_sample_behind_it() -> None:
    time = np.array([0.0, 50.0, 100.0, 100.0, 160.0, 220.0])
    steps = (Step(StepKind.CC_DISCHARGE, 0, 3), Step(StepKind.REST, 3, 6, position=1))
    current = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    record = Trajectory(
        time, current, np.array([3.0, 2.9, 2.8, 3.2, 3.2, 3.21]), steps=steps, inserted=np.arange(6) == 3
    )
    simulated = record.changed(voltage=record.voltage + np.array([0.01, 0.01, 0.01, -0.3, 0.01, 0.01]))
    at, found = _Curve("fit", simulated).residual(_Curve("measured", record), VOLTAGE)
    assert not np.any((at > 100.0) & (at < 160.0))
    assert set(time) <= set(at)
    np.testing.assert_allclose(found, 10.0)
