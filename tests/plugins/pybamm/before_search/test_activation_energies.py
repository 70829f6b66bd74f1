"""Diffusivities and conductivities that depend on the temperature, in sets in which they do not."""

import numpy as np
import pytest
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment, ParameterFile
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.before_search.activation_energies import (
    TRANSPORT,
    additional_energy_name,
    energy_name,
    independent_of_temperature,
    with_activation_energies,
    with_additional_energies,
)
from bsa.plugins.pybamm.cells.parameter_files import as_json, parsed
from bsa.plugins.pybamm.cells.parameter_sets import load, pybamm
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

GAS_CONSTANT = 8.314462618


def at(values: pybamm.ParameterValues, name: str, kelvin: float) -> float:
    own, usual = values[name], pybamm.Scalar(TRANSPORT[name].usual)
    symbol = own(usual, pybamm.Scalar(kelvin)) if callable(own) else pybamm.Scalar(own)
    return float(values.process_symbol(symbol).evaluate())


@pytest.fixture(scope="module")
def warmed() -> ParameterFile:
    return with_activation_energies("Chen2020", independent_of_temperature("Chen2020"))


def test_sets_with_an_own_dependence_are_told_from_those_without() -> None:
    assert independent_of_temperature("OKane2022") == ()
    assert independent_of_temperature("Chen2020") == tuple(TRANSPORT)


@pytest.mark.parametrize("name", TRANSPORT)
def test_the_law_is_that_of_arrhenius_around_the_reference_temperature(warmed: ParameterFile, name: str) -> None:
    own, values = load("Chen2020"), load(warmed)
    assert values[energy_name(name)] == TRANSPORT[name].energy
    assert at(values, name, 298.15) == pytest.approx(at(own, name, 298.15), rel=1e-12)
    law = np.exp(TRANSPORT[name].energy / GAS_CONSTANT * (1 / 298.15 - 1 / 318.15))
    assert at(values, name, 318.15) / at(own, name, 318.15) == pytest.approx(law, rel=1e-6)
    assert independent_of_temperature(warmed) == ()


def test_an_activation_energy_can_be_given(warmed: ParameterFile) -> None:
    name = "Positive particle diffusivity [m2.s-1]"
    given = load(warmed, {energy_name(name): 0.0})
    assert at(given, name, 318.15) == at(given, name, 298.15)


def test_the_set_is_a_file_that_is_read_as_a_strangers_is(warmed: ParameterFile) -> None:
    assert parsed("chen.json", warmed.text).kind == "parameter-values"


@pytest.mark.parametrize("base", ["OKane2022", "Prada2013"])
def test_an_additional_energy_changes_nothing_until_it_is_given(base: str) -> None:
    file, name = with_additional_energies(base), "Negative particle diffusivity [m2.s-1]"
    own, more = load(base), load(file, {additional_energy_name(name): 1e4})
    for kelvin in (278.15, 298.15, 318.15):
        law = np.exp(1e4 / GAS_CONSTANT * (1 / 298.15 - 1 / kelvin))
        assert at(load(file), name, kelvin) == pytest.approx(at(own, name, kelvin), rel=1e-12)
        assert at(more, name, kelvin) == pytest.approx(law * at(own, name, kelvin), rel=1e-6)


def test_a_constant_exchange_current_density_gets_an_additional_energy_too() -> None:
    name, values = "Negative electrode exchange-current density [A.m-2]", load("Chen2020")
    values.update({name: 2.0})
    file = with_additional_energies(parsed("constant.json", as_json(values)))
    more = load(file, {additional_energy_name(name): 1e4})
    j0 = more[name](*(pybamm.Scalar(one) for one in (1000.0, 15000.0, 30000.0, 318.15)))
    law = np.exp(1e4 / GAS_CONSTANT * (1 / 298.15 - 1 / 318.15))
    assert float(more.process_symbol(j0).evaluate()) == pytest.approx(2.0 * law, rel=1e-6)


def test_the_name_of_a_set_tells_of_its_activation_energies_once(warmed: ParameterFile) -> None:
    assert with_additional_energies(warmed).name == "Chen2020 with activation energies (searched)"
    assert with_additional_energies("OKane2022").name == "OKane2022 with additional activation energies"


@pytest.mark.slow
def test_a_warm_cell_is_less_polarised_and_a_cold_one_the_same(warmed: ParameterFile) -> None:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))

    def end_of_discharge(parameters: str | ParameterFile, kelvin: float) -> float:
        experiment = Experiment("r", nothing, (("Discharge at 2C for 10 minutes",),), None, kelvin, 0.9)
        run = solve_reference(CellModel(parameters, "SPMe"), experiment, CellChange())
        assert run.trajectory is not None
        return float(run.trajectory.voltage[-1])

    assert end_of_discharge(warmed, 298.15) == pytest.approx(end_of_discharge("Chen2020", 298.15), abs=1e-5)
    assert end_of_discharge(warmed, 318.15) > end_of_discharge("Chen2020", 318.15) + 2e-3
