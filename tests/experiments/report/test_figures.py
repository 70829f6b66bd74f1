"""Residuals as figures draw them."""

from __future__ import annotations

import numpy as np
from bsa.core.cell import CURRENT, TEMPERATURE, VOLTAGE
from bsa.core.comparison.record_errors import RecordErrors
from bsa.core.inference.prediction import Band, Prediction
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.report.figures import Overlay, _Curve, prediction_overlays


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


def predicted(at_limit: tuple[tuple[float, float], ...], half_mv: float) -> Overlay:
    time = np.linspace(0.0, 100.0, 101)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 101),)
    target = Trajectory(time, np.ones(101), 4.0 - time / 100, np.full(101, 298.15), steps)
    box = ParameterSpace((Parameter("a", 0.2, 0.0, 1.0),))
    fitted = Experiment("fitted", target)
    task = Task("t", CellModel("Chen2020"), box, (fitted,), held_out=(Experiment("new", target.slice(0, 100)),))
    curve = target.changed(voltage=target.voltage + 0.01, voltage_band=np.full(101, 1e-3 * half_mv))
    bands = {"voltage": Band(half_mv, half_mv, 1.0)}
    prediction = Prediction(RecordErrors("new", {}), bands, curve, at_limit=at_limit)
    (overlay,) = prediction_overlays(task, [prediction])
    return overlay


def band_lines(overlay: Overlay) -> list[int]:
    """Number of lines of a band in each panel."""
    return [sum(line.style == "limit" for line in panel.lines) for panel in overlay.chart.panels]


def test_a_band_is_drawn_where_the_simulated_cell_is_at_no_limit() -> None:
    whole, cut = predicted((), 5.0), predicted(((40.0, 60.0),), 5.0)
    assert max(band_lines(whole)) == 2
    assert max(band_lines(cut)) == 4
    assert not any("empty" in remark for remark in whole.remarks)
    assert "There is no band where the simulated cell is empty or full." in cut.remarks


def test_a_band_that_lies_outside_its_panel_is_told() -> None:
    seen, unseen = predicted((), 5.0), predicted((), 500.0)
    assert len(seen.remarks) == 1
    assert "The 95 % band of the voltage, ± 500 mV to ± 500 mV, lies outside its panel." in unseen.remarks


def test_temperatures_are_drawn_in_degc_and_their_residuals_in_kelvin() -> None:
    time = np.linspace(0.0, 100.0, 11)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 11),)
    target = Trajectory(time, np.ones(11), 4.0 - time / 100, 298.15 + time / 20, steps)
    box = ParameterSpace((Parameter("a", 0.2, 0.0, 1.0),))
    signals = (CURRENT, VOLTAGE, TEMPERATURE)
    fitted, new = Experiment("fitted", target), Experiment("new", target.slice(0, 10))
    task = Task("t", CellModel("Chen2020"), box, (fitted,), signals=signals, held_out=(new,))
    (overlay,) = prediction_overlays(task, [Prediction(RecordErrors("new", {}), {}, target)])
    panels = {panel.label: panel for panel in overlay.chart.panels}
    assert "Residual / K" in panels
    assert [tick.label for tick in panels["Temperature / degC"].ticks] == ["26", "28", "30"]
