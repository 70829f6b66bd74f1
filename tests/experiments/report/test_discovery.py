"""The report of a discovery."""

import numpy as np
from bsa.core.discovery.observations import observe
from bsa.core.discovery.simulator import MeasuredRecord, Prediction
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.report.discovery import _figure


def test_a_figure_claims_no_error_that_was_not_scored() -> None:
    time = np.linspace(0.0, 3600.0, 61)
    record = Trajectory(time, np.ones(61), 4.0 - time / 3600.0, steps=(Step(StepKind.CC_DISCHARGE, 0, 61),))
    observed = observe(MeasuredRecord("a.csv", record))
    figure = _figure(0, observed, Prediction(observed.voltage + 0.01), Prediction(observed.voltage + 0.001))
    assert figure.chart.description == "Measured and simulated voltage."
