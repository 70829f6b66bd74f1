import numpy as np
import pytest
from bsa.core.target import CellChange
from bsa.core.task import CellModel
from bsa.plugins.pybamm.cells.parameter_sets import load, pybamm
from bsa.plugins.pybamm.cells.state_of_charge import (
    InitialState,
    equilibrium_capacity_ah,
    initial_concentration,
    socs_at_voltages,
)


def soc_at_voltage(cell: CellModel, voltage: float, temperature_k: float | None = None) -> float:
    return socs_at_voltages(cell, [voltage], temperature_k)[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Chen2020", "OKane2022", "Prada2013"])
def test_states_of_charge_and_capacities_are_those_of_pybamm(name: str) -> None:
    values = load(name)
    empty, full, *_ = pybamm.lithium_ion.get_min_max_stoichiometries(values)
    for voltage in (3.25, 3.3, 3.4):
        x = pybamm.lithium_ion.get_initial_stoichiometries(f"{voltage} V", values)[0]
        assert soc_at_voltage(CellModel(name), voltage) == pytest.approx((x - empty) / (full - empty), abs=2e-4)
    held_ah = values.evaluate(pybamm.LithiumIonParameters().n.prim.Q_init)
    assert equilibrium_capacity_ah(name, {}) == pytest.approx(held_ah * (full - empty), rel=2e-4)


def test_factors_multiply_hosts_and_the_lithium_between_them():
    state = InitialState(load("Chen2020"))
    negative, positive = (initial_concentration(which) for which in ("Negative", "Positive"))
    usual = state.concentrations(CellChange(), 0.5)
    roomy = state.concentrations(CellChange(factors={"Positive electrode active material volume fraction": 1.1}), 0.5)
    richer = state.concentrations(CellChange(cyclable_lithium=1.02), 0.5)
    assert roomy != pytest.approx(usual, rel=1e-3)
    # More lithium at one state of charge shows in the positive electrode: less room is left there.
    assert richer[positive] > usual[positive]
    assert state.concentrations(CellChange(), None)[negative] == pytest.approx(load("Chen2020")[negative])


def test_a_changed_cell_starts_where_it_shows_the_voltage() -> None:
    state = InitialState(load("Chen2020"))
    change = CellChange(factors={"Negative electrode OCP [V]": 1.3}, cyclable_lithium=0.95)
    for voltage in (3.2, 3.7, 4.1):
        soc = state.soc_at(voltage, change)
        balance = state._balance(change)
        x, curve = balance.x, balance.voltage
        negative = state.concentrations(change, soc)["Initial concentration in negative electrode [mol.m-3]"]
        assert np.interp(negative / 33133.0, x, curve) == pytest.approx(voltage, abs=1e-3)
    assert state.soc_at(4.25) > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Mohtat2020", "Ai2020"])
def test_a_cold_cell_starts_at_the_voltage_as_pybamm_has_it(name: str) -> None:
    values = load(name)
    values.update({"Initial temperature [K]": 273.15, "Ambient temperature [K]": 273.15})
    empty, full, *_ = pybamm.lithium_ion.get_min_max_stoichiometries(values)
    x = pybamm.lithium_ion.get_initial_stoichiometries("3.8 V", values)[0]
    assert InitialState(values).soc_at(3.8) == pytest.approx((x - empty) / (full - empty), abs=5e-4)
    assert abs(InitialState(load(name)).soc_at(3.8) - InitialState(values).soc_at(3.8)) > 5e-3


@pytest.mark.parametrize("voltage", [3.8, 4.2])
def test_a_voltage_is_that_at_a_temperature(voltage: float) -> None:
    cell = CellModel("Mohtat2020", "SPM")
    values = load("Mohtat2020")
    values.update({"Initial temperature [K]": 273.15})
    cold = soc_at_voltage(cell, voltage, 273.15)
    assert cold == pytest.approx(InitialState(values).soc_at(voltage), abs=5e-4)
    assert soc_at_voltage(cell, voltage, 298.15) == soc_at_voltage(cell, voltage)
    assert soc_at_voltage(cell, voltage) - cold > 5e-3


def test_a_cut_off_that_is_moved_moves_no_state_of_charge() -> None:
    usual = soc_at_voltage(CellModel("Ai2020", "SPM"), 4.15)
    for upper in (4.1, 4.35):
        moved = CellModel("Ai2020", "SPM", overrides={"Upper voltage cut-off [V]": upper})
        assert soc_at_voltage(moved, 4.15) == pytest.approx(usual, abs=1e-6)
    assert 0.9 < usual < 0.99
