import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.discovery.ranking import ask
from bsa.plugins.effects.catalogue import EFFECTS

HEAT = [
    "measured voltage lies 28 mV above the model during a: CC discharge at 2C, growing with time (80% of the excess)"
]
AGEING = ["by cycle: 30 mV rms (+3 mV) for cycle 19, 1.0 mV for cycle 1"]


@pytest.mark.parametrize("hide_names", [False, True])
def test_signatures_are_read_and_names_are_not(hide_names):
    ranking = ask(RulesBackend(), HEAT, EFFECTS, seed=3, hide_names=hide_names)
    assert ranking.ranked[0].key == "self-heating"
    assert "a voltage above the model" in ranking.ranked[0].reason
    named = {r.key.split(" (")[0] for r in ask(RulesBackend(), AGEING, EFFECTS, 3, hide_names).ranked}
    assert named <= {"sei-growth", "loss-of-active-material", "porosity-change", "lithium-plating"}


def test_words_that_no_signature_shares_still_make_a_ranking():
    ranking = ask(RulesBackend(), ["nothing of note"], EFFECTS, seed=3)
    assert 1 <= len(ranking.ranked) <= 5
    assert not ranking.note
