"""The forecast of a life in a line, for whoever waits for it."""

import numpy as np

from ...core.ageing.fade_band import CAPACITY
from ...core.inference.prediction import Prediction
from ...core.task import Experiment
from .wording import number


def forecast_line(forecast: Prediction, measured: Experiment) -> str:
    """``"Forecast of life.csv, cycles 201 to 400: capacity 0.942 A h in cycle 400, measured 0.931; ..."``."""
    errors, cycles = forecast.errors, measured.target.cycle_table
    table = None if forecast.curve is None else forecast.curve.cycle_table
    said = [f"the simulation stopped early: {errors.failure}"] * bool(errors.failure)
    if table is not None and cycles is not None:
        last = min(table.cycle[-1], cycles.cycle[-1])
        ours, theirs = (number(float(one.at(np.array([last]))[0])) for one in (table, cycles))
        said.append(f"capacity {ours} A h in cycle {last:.0f}, measured {theirs}")
    if CAPACITY in errors.signals:
        rms, most = (number(value, 2) for value in (errors.signals[CAPACITY].rms, errors.signals[CAPACITY].max))
        said.append(f"off by {rms} % of the first capacity rms, {most} % at most")
    return f"Forecast of {errors.record}: {'; '.join(said)}."
