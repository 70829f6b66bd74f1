"""A cell that is driven by its measured current."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.task import CellModel
from bsa.core.trajectory import FloatArray, Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

(MARCUS,) = (effect for effect in EFFECTS if effect.key == "kinetics-marcus")
WARM = Start(temperature_k=298.15)


@pytest.mark.slow
def test_a_current_that_no_potential_gives_is_told_soon(rest_then_discharge):
    clock = np.arange(0.0, 4000.0, 20.0)
    record = rest_then_discharge(clock, 60.0, 1.7)
    cell = DrivenCell(CellModel("Chen2020", "SPMe"), (MARCUS,), record, {}, WARM)
    (strength,) = (MARCUS.full_name(parameter) for parameter in MARCUS.parameters)

    def took(value: float) -> tuple[float, str]:
        start = time.process_time()
        response = cell.follow({strength: value}, clock, 0.9)
        return time.process_time() - start, response.cause

    took(0.0)  # compiles
    usual = max(took(0.0)[0] for _ in range(3))
    seconds, cause = took(20.0)
    assert cause
    # 40 usual ones; with PyBaMM's own limits 300.
    assert seconds < 120.0 * usual


@pytest.mark.slow
def test_a_cell_that_a_leak_empties_in_a_rest_is_empty():
    (leak,) = (effect for effect in EFFECTS if effect.key == "self-discharge")
    clock = np.concatenate([np.arange(0.0, 601.0, 10.0), np.arange(700.0, 20001.0, 100.0)])
    loaded = int(np.count_nonzero(clock <= 600.0))
    steps = (Step(StepKind.CC_DISCHARGE, 0, loaded), Step(StepKind.REST, loaded, len(clock), position=1))
    record = Trajectory(clock, np.where(clock <= 600.0, 1.0, 0.0), np.full(len(clock), 3.2), None, steps)
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (leak,), record, {}, WARM)
    response = cell.follow({leak.full_name(leak.strength): 0.3}, clock, 0.06)
    assert [pause.empty for pause in response.pauses] == [True]
    assert response.voltage[-1] < 2.1


class Stretch:
    """What an integrator solved, as `DrivenCell` reads it."""

    def __init__(self, time: FloatArray, voltage: FloatArray) -> None:
        self.t = time
        self._values = {"Voltage [V]": voltage, "Volume-averaged cell temperature [K]": np.full(len(time), 298.15)}

    def __getitem__(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(data=self._values[name])


@pytest.mark.slow
@pytest.mark.parametrize(("last_fall_v", "empties"), [(0.06, True), (0.006, False)])
def test_an_integrator_that_gives_up_where_the_voltage_collapses_met_an_empty_cell(
    rest_then_discharge, monkeypatch, last_fall_v, empties
):
    """At 10 degC it gave up at 2.94 V, a second before 2.5 V, and the simulation was taken for a failed one."""
    clock = np.arange(0.0, 4001.0, 20.0)
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (), rest_then_discharge(clock, 60.0, 5.0), {}, WARM)
    discharge = np.arange(80.0, 2001.0, 20.0)
    falling = 3.6 - 0.006 * np.arange(len(discharge))
    falling[-1] = falling[-2] - last_fall_v

    def solved(before, *_):
        if before is None:
            return Stretch(discharge, falling), "the integrator gave up"
        return Stretch(np.array([2000.0, 4000.0]), np.array([3.1, 3.2])), ""

    monkeypatch.setattr(cell, "_advance", solved)
    response = cell.follow({}, clock, 0.9)
    assert [pause.empty for pause in response.pauses] == [True] * empties
    assert bool(response.cause) is not empties


@pytest.mark.slow
def test_an_integrator_that_gives_up_at_once_says_so(rest_then_discharge, monkeypatch):
    clock = np.arange(0.0, 401.0, 20.0)
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (), rest_then_discharge(clock, 60.0, 5.0), {}, WARM)
    nothing = Stretch(np.array([0.0]), np.array([3.8]))
    monkeypatch.setattr(cell, "_advance", lambda *_: (nothing, "the integrator gave up"))
    response = cell.follow({}, clock, 0.9)
    assert (response.cause, response.pauses) == ("the integrator gave up", ())
