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
        ({"thermal": "warm"}, {"thermal": "warm"}),
    ],
)
def test_options_may_be_written_in_any_case_and_as_booleans(given, known) -> None:
    assert in_pybamm_spelling(given) == known


def test_an_option_that_does_not_exist_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(BsaError, match='no model option "therml"') as found:
        in_pybamm_spelling({"sei": "reaction limited", "therml": "lumped"})
    assert found.value.hint == 'did you mean "thermal"?'
