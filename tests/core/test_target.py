import pytest
from bsa.core.encoding import decode_parameter, encode_parameter
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import (
    CellChange,
    CyclableLithium,
    DiffusivityShape,
    EffectValue,
    Factor,
    InitialSoc,
    InitialVoltage,
    OcpShape,
    Value,
    change_of,
    initial_voltage_name,
    soc_name,
    target_named,
)
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("Separator thickness [m]", Value("Separator thickness [m]")),
        ("Positive electrode OCP [V] factor", Factor("Positive electrode OCP [V]")),
        ("Initial state of charge", InitialSoc()),
        ("Initial state of charge: 1 cell factor", InitialSoc("1 cell factor")),
        ("Initial voltage correction [V]", InitialVoltage()),
        ("Initial voltage correction at 4.18 V [V]", InitialVoltage(4.18)),
        ("Cyclable lithium factor", CyclableLithium()),
        ("Thermodynamic factor", Value("Thermodynamic factor")),
        ("Thermodynamic factor factor", Factor("Thermodynamic factor")),
        ("Positive electrode OCP correction at stoichiometry 0.3 [V]", OcpShape("Positive", 0.3)),
        ("Negative particle diffusivity factor at stoichiometry 0.1", DiffusivityShape("Negative", 0.1)),
        (
            "Positive electrode OCP correction at stoichiometry 1.3 [V]",
            Value("Positive electrode OCP correction at stoichiometry 1.3 [V]"),
        ),
    ],
)
def test_a_name_in_a_persons_notation_means_one_target(name, target):
    assert target_named(name) == target


def test_a_parameter_of_the_set_is_a_value_whatever_its_name_ends_with():
    assert target_named("Contact area factor", {"Contact area factor"}) == Value("Contact area factor")


def test_a_parameter_acts_on_the_number_of_its_name_unless_it_says_otherwise():
    space = ParameterSpace(
        (Parameter("Damping factor", 1.0, 0.1, 10.0), Parameter("D factor", 1.0, 0.1, 10.0, target=Factor("D")))
    )
    change = space.change({"Damping factor": 2.0, "D factor": 3.0})
    assert (change.values, change.factors) == ({"Damping factor": 2.0}, {"D": 3.0})


def test_a_candidate_is_sorted_by_what_it_acts_on():
    candidate = {"R [m]": 2.0, "D factor": 3.0, soc_name("a"): 0.4, "Cyclable lithium factor": 0.9}
    candidate |= {"Negative electrode OCP correction at stoichiometry 0.25 [V]": 0.01, "unknown": 7.0}
    targets = {name: target_named(name) for name in candidate if name != "unknown"} | {"x: y": EffectValue("x", "y")}
    change = change_of(targets, {**candidate, "x: y": 1.0})
    assert change == CellChange(
        {"R [m]": 2.0}, {"D": 3.0}, 0.9, {"a": 0.4}, {}, {OcpShape("Negative", 0.25): 0.01}, effects={"x: y": 1.0}
    )
    assert (change.soc_of("a"), change.soc_of("b")) == (0.4, None)
    assert CellChange(initial_soc={"": 0.2}).soc_of("any") == 0.2


@pytest.mark.parametrize(
    "target",
    [
        None,
        Value("p"),
        Factor("p"),
        InitialSoc("r"),
        CyclableLithium(),
        OcpShape("Negative", 0.1),
        EffectValue("e", "p"),
    ],
)
def test_what_a_parameter_acts_on_survives_the_journal(target):
    parameter = Parameter("p", 1.0, 0.5, 2.0, "log", target, deviation=0.1, prior=True)
    assert decode_parameter(encode_parameter(parameter)) == parameter


def test_a_journal_of_an_earlier_version_names_targets_by_their_parameters():
    earlier = {"name": "D factor", "initial": 1.0, "lower": 0.5, "upper": 2.0, "scale": "log"}
    assert decode_parameter(earlier).target == Factor("D")


@given(st.floats(2.0, 4.5), st.floats(-0.1, 0.1))
def test_a_rest_voltage_is_corrected_by_what_is_known_near_it(rest_v: float, correction: float) -> None:
    everywhere = CellChange(initial_voltage={None: correction})
    assert everywhere.started_at(rest_v) == pytest.approx(rest_v + correction)
    full_and_empty = CellChange(initial_voltage={4.18: correction, 3.2: 0.05})
    added = full_and_empty.started_at(rest_v) - rest_v
    nearest = correction if rest_v > 3.69 else 0.05
    assert abs(added) <= abs(nearest) + 1e-12
    assert full_and_empty.started_at(4.18) == pytest.approx(4.18 + correction)
    assert full_and_empty.started_at(3.7) == pytest.approx(3.7, abs=1e-6)  # half a volt away nothing is known


def test_a_correction_goes_by_its_name_and_through_the_journal() -> None:
    name = initial_voltage_name(4.184)
    parameter = Parameter(name, 0.0, -0.1, 0.1, target=target_named(name))
    assert parameter.target == InitialVoltage(4.18)
    assert decode_parameter(encode_parameter(parameter)) == parameter
    assert change_of({name: InitialVoltage(4.18)}, {name: 0.01}) == CellChange(initial_voltage={4.18: 0.01})
