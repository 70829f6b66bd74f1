import pytest
from bsa.core.errors import BsaError
from bsa.core.target import CellChange
from bsa.core.task import CellModel
from bsa.plugins.pybamm.cells import parameter_sets
from bsa.plugins.pybamm.cells.state_of_charge import InitialState, equilibrium_capacity_ah, socs_at_voltages


def test_missing_keys_are_filled_from_chen2020() -> None:
    name = "SEI resistivity [Ohm.m]"
    assert parameter_sets.load("Prada2013")[name] == parameter_sets.load("Chen2020")[name]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Negative electrode thickness", 'did you mean "Negative electrode thickness [m]"'),
        ("Negative particle diffusivity [m2.s-1]x", "is not a parameter of Chen2020"),
        ("Negative electrode exchange-current density [A.m-2]", "is a function"),
        ("Separator thickness [m] factor", "is a number"),
    ],
)
def test_names_that_cannot_be_searched_say_what_to_write(name: str, words: str) -> None:
    with pytest.raises(BsaError) as caught:
        parameter_sets.initial_value("Chen2020", name)
    assert words in str(caught.value)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Xu2019", '"Negative electrode OCP [V]" is a number, 0'),
        ("Ecker2015_graphite_halfcell", '"Negative electrode OCP [V]" is a number, 0'),
        ("Chen2020_composite", "an electrode is a blend of two materials"),
        ("Bonkile2024", "an electrode is a blend of two materials"),
        ("MSMR_Example", 'it lacks "Negative electrode OCP [V]", "Positive electrode OCP [V]"'),
        ("ECM_Example", 'it lacks "Electrode width [m]"'),
        ("Sulzer2019", 'it lacks "Negative electrode OCP [V]"'),
    ],
)
def test_a_set_that_is_no_full_cell_is_refused_and_not_listed(name: str, reason: str) -> None:
    """Its own electrodes would be completed, without a word, with those of Chen2020."""
    with pytest.raises(BsaError, match=f"{name} is no full cell") as caught:
        parameter_sets.load(name)
    assert reason in caught.value.message
    assert name not in parameter_sets.set_names()


def test_every_listed_set_has_electrodes_of_its_own() -> None:
    assert {"Ai2020", "Chen2020", "Marquis2019", "ORegan2022"} <= set(parameter_sets.set_names())
    for name in parameter_sets.set_names():
        assert set(parameter_sets.WHOLE_SET) <= set(parameter_sets.pybamm.ParameterValues(name).keys())


def test_the_list_of_parameters_tells_numbers_from_functions() -> None:
    found = parameter_sets.parameters("Chen2020")
    assert found["Separator thickness [m]"] == 1.2e-5
    assert found["Negative electrode exchange-current density [A.m-2]"] == "function"


def test_a_voltage_and_a_state_of_charge_are_one() -> None:
    cell = CellModel("Chen2020")
    soc, *beyond = socs_at_voltages(cell, [3.8, 5.0, 1.0])
    assert 0.4 < soc < 0.7
    assert beyond == [1.0, 0.0]
    state = InitialState(parameter_sets.load("Chen2020")).concentrations(CellChange(), soc)
    values = parameter_sets.load("Chen2020", state)
    assert float(values.evaluate(parameter_sets.pybamm.LithiumIonParameters().ocv_init)) == pytest.approx(3.8, abs=2e-4)


def test_a_wider_electrode_holds_more() -> None:
    own = parameter_sets.load("Chen2020")
    wider = {"Electrode width [m]": 2 * own["Electrode width [m]"]}
    assert equilibrium_capacity_ah("Chen2020", wider) == pytest.approx(2 * equilibrium_capacity_ah("Chen2020", {}))
