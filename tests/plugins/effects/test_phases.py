import pytest
from bsa.core.effect import Evidence
from bsa.plugins.effects.phases import one_phase_lacks


@pytest.mark.parametrize(
    ("options", "negative", "positive"),
    [
        ({}, "", ""),
        ({"working electrode": "positive"}, "no negative electrode", ""),
        ({"particle phases": ("2", "1")}, "several phases", ""),
        ({"particle phases": "2"}, "several phases", "several phases"),
    ],
)
def test_electrodes_without_particles_of_one_phase_are_told(options: dict, negative: str, positive: str) -> None:
    for which, words in (("negative", negative), ("positive", positive)):
        said = one_phase_lacks(which, Evidence("DFN", options, 1, 0.0, 1.0))
        assert words in said
        assert bool(said) == bool(words)
