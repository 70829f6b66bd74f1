import pytest
from bsa.plugins.pybamm.model_options import in_pybamm_spelling


@pytest.mark.parametrize(
    ("given", "known"),
    [
        ({"contact resistance": True}, {"contact resistance": "true"}),
        ({"Contact Resistance": "TRUE"}, {"contact resistance": "true"}),
        ({"contact resistance": False}, {"contact resistance": "false"}),
        ({"sei": "Reaction Limited"}, {"SEI": "reaction limited"}),
        ({"thermal": "Lumped", "particle phases": ("2", 1)}, {"thermal": "lumped", "particle phases": ["2", "1"]}),
        ({"no such option": "X"}, {"no such option": "X"}),
    ],
)
def test_options_may_be_written_in_any_case_and_as_booleans(given, known) -> None:
    assert in_pybamm_spelling(given) == known
