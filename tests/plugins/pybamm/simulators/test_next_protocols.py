"""Currents and voltages of what could be measured next are those of the cell, not of its parameter set."""

import numpy as np
import pytest
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.cells.parameter_sets import load, pybamm
from bsa.plugins.pybamm.simulators.next_protocols import next_protocols
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
WIDTH = "Electrode width [m]"


def test_rates_are_those_of_a_cell_of_another_size() -> None:
    cell = CellModel("Chen2020", "SPM", overrides={WIDTH: 0.22 * float(load("Chen2020")[WIDTH])})  # 1.1 A.h
    found = next_protocols(cell)
    slow = Experiment("slow", NOTHING, found["slow discharge at C/20"], initial_soc=1.0)
    run = solve_reference(cell, slow, CellChange()).trajectory
    assert run is not None
    assert run.current[1] == pytest.approx(1.1 / 20)
    assert 18 < run.duration / 3600 < 24
    steps = [step for protocol in found.values() for cycle in protocol for step in cycle]
    assert all(pybamm.step.string(step) for step in steps)
    assert not any(" C/" in step or "1C" in step or "2C" in step for step in steps)


def test_no_cell_is_charged_beyond_its_own_cut_off() -> None:
    # As a calibration by protocol widens them, so that a record's own steps end a cycle.
    widened = {
        "Lower voltage cut-off [V]": 2.3,
        "Upper voltage cut-off [V]": 4.4,
        "Open-circuit voltage at 0% SOC [V]": 2.5,
        "Open-circuit voltage at 100% SOC [V]": 4.2,
    }
    steps = str(next_protocols(CellModel("Chen2020", "SPM", overrides=widened)))
    assert "4.4 V" not in steps
    assert "until 4.2 V" in steps
    assert "until 2.5 V" in steps
