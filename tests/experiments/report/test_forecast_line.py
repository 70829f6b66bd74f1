"""What is said of a forecast."""

from dataclasses import replace

from bsa.core.comparison.record_errors import RecordErrors, SignalError
from bsa.core.inference.prediction import Prediction
from bsa.experiments.report.forecast_line import forecast_line
from bsa_toy_life import fading_task, life


def test_a_forecast_is_told_by_its_capacity_and_how_far_it_came() -> None:
    (later,) = fading_task().held_out
    errors = RecordErrors(later.name, {"capacity": SignalError("%", 1.234, 5.0, 1.0)})
    whole = forecast_line(Prediction(errors, {}, life(100, 0.1)), later)
    assert whole == (
        "Forecast of later: capacity 0.9 A h in cycle 100, measured 0.8; "
        "off by 1.2 % of the first capacity rms, 5 % at most."
    )
    nothing = Prediction(replace(errors, signals={}, failure="no ions, in cycle 1 of 100"), {}, None)
    assert forecast_line(nothing, later) == (
        "Forecast of later: the simulation stopped early: no ions, in cycle 1 of 100."
    )
