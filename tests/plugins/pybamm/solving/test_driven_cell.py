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


def a_charge_and_its_hold(hold_s: float = 3600.0) -> Trajectory:
    """1C until 6,000 s, then a hold whose current falls to a twentieth."""
    charge, hold = np.arange(0.0, 1801.0, 60.0), np.arange(60.0, hold_s + 1.0, 60.0)
    clock = np.concatenate([charge, 1800.0 + hold])
    current = np.concatenate([np.full(len(charge), -5.0), -5.0 * 20.0 ** (-hold / hold_s)])
    steps = (Step(StepKind.CC_CHARGE, 0, len(charge)), Step(StepKind.CV_HOLD, len(charge), len(clock), position=1))
    return Trajectory(clock, current, np.full(len(clock), 4.2), None, steps)


@pytest.mark.slow
def test_a_cell_that_is_full_for_a_moment_takes_the_rest_of_a_hold():
    record = a_charge_and_its_hold()
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (), record, {}, WARM)
    fuller = [cell.follow({}, record.time, soc) for soc in np.linspace(0.29, 0.39, 11)]
    charge = [np.trapezoid(-cell.current(record.time, response.pauses), record.time) / 3600.0 for response in fuller]
    assert len(fuller[0].pauses) == 0
    assert len(fuller[-1].pauses) > 1
    assert not any(pause.empty for response in fuller for pause in response.pauses)
    # A hundredth of the cell's charge more at the start is about as much less until it is full.
    assert np.max(-np.diff(charge)) < 0.1


@pytest.mark.slow
def test_a_cell_whose_voltage_collapses_in_a_charge_is_full(rest_then_discharge, monkeypatch):
    """Beyond the data of its potential, LiCoO2 of Ai2020 falls from 4.4 to 0 V when it is overcharged."""
    record = a_charge_and_its_hold()
    cell = DrivenCell(CellModel("Chen2020", "SPM"), (), record, {}, WARM)
    falling = np.append(np.linspace(4.0, 4.4, 20), 0.01)

    def solved(before, *_):
        if before is None:
            return Stretch(np.linspace(0.0, 1500.0, 21), falling), ""
        return Stretch(np.array([1800.0, 5400.0]), np.array([4.1, 4.2])), ""

    monkeypatch.setattr(cell, "_advance", solved)
    response = cell.follow({}, record.time, 0.5)
    assert [pause.empty for pause in response.pauses] == [False]
