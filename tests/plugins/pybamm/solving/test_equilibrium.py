"""The open-circuit voltage along a measured current, against PyBaMM's own bulk open-circuit voltage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import target_named
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.augmentation import effects_in
from bsa.plugins.pybamm.cells.ocp_shape import corrected
from bsa.plugins.pybamm.cells.parameter_sets import load, pybamm
from bsa.plugins.pybamm.modelling.compiled_cell import start_of
from bsa.plugins.pybamm.modelling.drive import shown_range
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell
from bsa.plugins.pybamm.solving.equilibrium import EquilibriumCell

BUMP = "Positive electrode OCP correction at stoichiometry 0.5 [V]"
CHANGED = {"Electrode width [m]": 1.7, "Negative electrode active material volume fraction": 0.8, BUMP: 0.02}


def parameter(name: str, initial: float) -> Parameter:
    return Parameter(name, initial, initial - 1.0, initial + 1.0, "linear", target=target_named(name))


def task_of(record: Trajectory, **start: float) -> Task:
    space = ParameterSpace(tuple(parameter(name, value) for name, value in CHANGED.items()))
    return Task("cell", CellModel("Chen2020", "SPM"), space, (Experiment("record", record, **start),))


def discharge(hours: float) -> Trajectory:
    time = np.linspace(0.0, 3600.0 * hours, 121)
    return Trajectory(
        time, np.full(121, 5.0), np.full(121, 3.7), np.full(121, 298.15), (Step(StepKind.CC_DISCHARGE, 0, 121),)
    )


def test_the_voltage_is_the_bulk_open_circuit_voltage_of_a_simulation() -> None:
    record = discharge(0.6)
    outcome = EquilibriumCell(task_of(record, initial_soc=0.9)).outcome(CHANGED)
    (run,) = outcome.runs
    assert run.trajectory is not None
    values = load("Chen2020")
    values.update({name: value for name, value in CHANGED.items() if name != BUMP})
    values.update({"Positive electrode OCP [V]": corrected(values["Positive electrode OCP [V]"], {0.5: 0.02})})
    simulation = pybamm.Simulation(pybamm.lithium_ion.SPM(), parameter_values=values)
    solution = simulation.solve(record.time, initial_soc=0.9)
    bulk = solution["Bulk open-circuit voltage [V]"](record.time)
    assert np.max(np.abs(run.trajectory.voltage - bulk)) < 5e-4
    assert run.trajectory.temperature == pytest.approx(record.temperature)


@pytest.mark.parametrize("parameter_set", ["Chen2020", "NCA_Kim2011"])
def test_a_cell_that_is_drawn_empty_shows_what_an_empty_cell_does_in_simulations(parameter_set: str) -> None:
    task = task_of(discharge(6.0), initial_soc=0.5)
    (run,) = EquilibriumCell(replace(task, cell=CellModel(parameter_set, "SPM"))).outcome(CHANGED).runs
    assert run.trajectory is not None
    lowest, _ = shown_range((2.5, 4.2), task.experiments[0].target.voltage)
    assert lowest <= run.trajectory.voltage[-1] < 2.5


def test_a_start_by_its_voltage_shows_it_whatever_the_candidate() -> None:
    cell = EquilibriumCell(task_of(discharge(0.1), initial_voltage=3.9))
    for width in (1.0, 1.7):
        (run,) = cell.outcome({**CHANGED, "Electrode width [m]": width}).runs
        assert run.trajectory is not None
        assert run.trajectory.voltage[0] == pytest.approx(3.9, abs=2e-3)


def test_electrodes_that_cannot_hold_the_lithium_are_a_failed_outcome() -> None:
    task = task_of(discharge(0.1), initial_soc=0.5)
    lithium = {f"Initial concentration in {which} electrode [mol.m-3]": 1.0 for which in ("negative", "positive")}
    bare = replace(task, cell=replace(task.cell, overrides=lithium))
    failure = EquilibriumCell(bare).outcome(CHANGED).failure
    assert failure is not None
    assert "lithium" in failure.cause


@pytest.mark.parametrize("effects", [(), ("current-gain",)])
def test_the_charge_at_a_switch_is_that_of_the_driven_cell(effects: tuple[str, ...]) -> None:
    # A discharge whose first sample comes ten minutes late, once with that sample at the switch too.
    time = np.concatenate([[0.0, 60.0], np.linspace(660.0, 3660.0, 6)])
    late = Trajectory(time, np.where(time > 60.0, 5.0, 0.0), np.full(8, 3.7), None, _steps(2, 8))
    time = np.insert(time, 2, 60.0)
    prompt = Trajectory(time, np.append([0.0, 0.0], np.full(7, 5.0)), np.full(9, 3.7), None, _steps(2, 9))
    found = []
    for record in (late, prompt):
        task = task_of(record, initial_soc=0.9)
        own = replace(task, cell=replace(task.cell, effects=effects))
        (run,) = EquilibriumCell(own).outcome(CHANGED).runs
        assert run.trajectory is not None
        found.append(run.trajectory.voltage)
    assert found[0] == pytest.approx(np.delete(found[1], 2), abs=1e-6)


def _steps(switch: int, stop: int) -> tuple[Step, ...]:
    return Step(StepKind.REST, 0, switch), Step(StepKind.CC_DISCHARGE, switch, stop)


def test_the_charge_is_that_of_the_current_which_an_effect_makes_of_the_measured_one() -> None:
    record = discharge(0.6)
    gained = record.changed(current=1.1 * record.current)
    task = task_of(record, initial_soc=0.9)
    own = replace(task, cell=replace(task.cell, effects=("current-gain",)))
    gain = {"current-gain: gain": 1.1}
    (effect,) = effects_in(own.cell)
    own = replace(own, space=ParameterSpace((*own.space, *effect.searched)))
    (found,) = EquilibriumCell(own).outcome({**CHANGED, **gain}).runs
    (wanted,) = EquilibriumCell(task_of(gained, initial_soc=0.9)).outcome(CHANGED).runs
    assert found.trajectory is not None
    assert wanted.trajectory is not None
    assert found.trajectory.voltage == pytest.approx(wanted.trajectory.voltage, abs=1e-9)


SHAPE = "ocp-shape.positive-electrode"


@pytest.mark.parametrize(("effects", "kelvin"), [((), 263.15), ((SHAPE,), 298.15), ((SHAPE,), 263.15)])
def test_temperature_and_effects_on_the_potentials_are_those_of_the_driven_cell(
    effects: tuple[str, ...], kelvin: float
) -> None:
    """A record so slow that the driven cell is at equilibrium, started at a voltage."""
    record = discharge(0.4)
    record = record.changed(time=300.0 * record.time, current=record.current / 300.0)
    task = task_of(record, initial_voltage=3.9, temperature_k=kelvin)
    own = replace(task, cell=CellModel("Mohtat2020", "SPM", effects=effects))
    searched = [p for effect in effects_in(own.cell) for p in effect.searched]
    own = replace(own, space=ParameterSpace((parameter(BUMP, 0.0), *searched)))
    candidate = {BUMP: 0.0, **{p.name: 0.04 if p.name.endswith("[V]") else 0.5 for p in searched}}
    (run,) = EquilibriumCell(own).outcome(candidate).runs
    start = start_of(own.experiments[0])
    driven = DrivenCell(own.cell, (), record, own.space.targets, start, any_start=False)
    assert run.trajectory is not None
    np.testing.assert_allclose(run.trajectory.voltage[0], 3.9, atol=5e-4)
    np.testing.assert_allclose(run.trajectory.voltage, driven.follow(candidate, record.time).voltage, atol=2e-3)


def test_an_offset_of_the_current_draws_its_charge_too() -> None:
    name = "Current offset: record [A]"
    task = task_of(discharge(0.5), initial_soc=0.9)
    space = ParameterSpace((*task.space, parameter(name, 0.0)))
    (run,) = EquilibriumCell(replace(task, space=space)).outcome({**CHANGED, name: 0.5}).runs
    more = discharge(0.5).changed(current=discharge(0.5).current + 0.5)
    (wanted,) = EquilibriumCell(task_of(more, initial_soc=0.9)).outcome(CHANGED).runs
    assert run.trajectory is not None
    assert wanted.trajectory is not None
    assert run.trajectory.voltage == pytest.approx(wanted.trajectory.voltage, abs=1e-9)
