import pytest
from bsa.core.errors import BsaError
from bsa.plugins.pybamm.cells.model_options import in_pybamm_spelling


@pytest.mark.parametrize(
    ("given", "known"),
    [
        ({"contact resistance": True}, {"contact resistance": "true"}),
        ({"Contact Resistance": "TRUE"}, {"contact resistance": "true"}),
        ({"contact resistance": False}, {"contact resistance": "false"}),
        ({"sei": "Reaction Limited"}, {"SEI": "reaction limited"}),
        ({"thermal": "Lumped", "particle phases": ("2", 1)}, {"thermal": "lumped", "particle phases": ["2", "1"]}),
        ({"dimensionality": 0}, {"dimensionality": 0}),
    ],
)
def test_options_may_be_written_in_any_case_and_as_booleans(given, known) -> None:
    assert in_pybamm_spelling(given) == known


def test_an_option_that_does_not_exist_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(BsaError, match='no model option "therml"') as found:
        in_pybamm_spelling({"sei": "reaction limited", "therml": "lumped"})
    assert found.value.hint == 'did you mean "thermal"?'


@pytest.mark.parametrize(
    ("given", "message", "hint"),
    [
        (
            {"thermal": "lump"},
            'the model option "thermal" has no value "lump".',
            'did you mean "lumped"? Values: isothermal, lumped, ',
        ),
        ({"sei": ["none", "reactoin limited"]}, '"SEI" has no value "reactoin limited"', 'mean "reaction limited"?'),
        ({"thermal": True}, '"thermal" has no value "true"', "Values: isothermal, "),
    ],
)
def test_a_value_that_an_option_does_not_have_is_refused_with_those_that_it_has(given, message, hint) -> None:
    with pytest.raises(BsaError) as found:
        in_pybamm_spelling(given)
    assert message in found.value.message
    assert hint in found.value.hint
