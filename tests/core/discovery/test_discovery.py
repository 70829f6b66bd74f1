"""The verdict of a discovery as a sentence."""

import numpy as np
import pytest
from bsa.core.discovery.explanation import Explanation
from bsa.core.discovery.findings import Findings, Gap, Nomination
from bsa.core.discovery.record_discovery import RecordDiscovery
from bsa.core.discovery.score import Score
from bsa.core.effect import Effect, EffectParameter
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import InitialSoc

NOISE, MORE = Adequacy(0.5, 0.5, 1.0), Adequacy(0.0, 0.0, 1.0)
ONE, TWO, OTHER = (
    Effect(name, name, "", (EffectParameter("size", "", 0.0, 0.0, 1.0, 0.1),), "a signature.", "")
    for name in ("one", "two", "other")
)


def found(
    verdict: str, effects: tuple[Effect, ...] = (ONE,), left: Adequacy = MORE, restricted: bool = False, tried: int = 3
) -> RecordDiscovery:
    space = ParameterSpace((Parameter("soc", 0.9, 0.0, 1.08, target=InitialSoc("a"), deviation=0.02),))
    fit = Refit(space, np.array([6.0]), np.zeros(9), np.ones((9, 1)), True)
    best = Explanation(effects, fit, left, 1e-3, 1e-3, np.zeros(9), np.ones(9))
    nominations = [Nomination(e, "" if n < tried else "no rest") for n, e in enumerate((ONE, TWO, OTHER))]
    findings = Findings(verdict, Gap(best, best, 1e-3, 1e-3), best, nominations=nominations)
    return RecordDiscovery(findings, [], [], ["Off by 2 mV"], 1.85, restricted=restricted)


@pytest.mark.parametrize(
    ("discovery", "words"),
    [
        (found("effect-found", left=NOISE), "One effect explains the discrepancy"),
        (found("effect-found"), "One effect explains part of the discrepancy"),
        (found("effect-found", (ONE, TWO)), "Two effects explain part of the discrepancy together"),
        (
            found("effect-found", restricted=True),
            "Of the effects that were asked for, one explains part of the discrepancy",
        ),
        (
            found("ambiguous", left=NOISE),
            "Several effects explain the discrepancy and cannot be told apart",
        ),
        (found("unexplained"), "None of the 3 effects that were tried explains the discrepancy"),
        (found("unexplained", tried=1), "The one effect that was tried does not explain the discrepancy"),
        (found("unexplained", tried=0), "No effect could be tried that would explain the discrepancy"),
        (
            found("unexplained", restricted=True),
            "Of the effects that were asked for, none explains the discrepancy",
        ),
        (found("no-missing-effect", (), NOISE), "Nothing is missing: noise explains what the base model leaves"),
    ],
)
def test_the_headline_says_no_more_than_what_was_found(discovery: RecordDiscovery, words: str) -> None:
    assert discovery.headline == words


def test_why_an_effect_was_not_fitted_is_what_happened() -> None:
    discovery = found("unexplained")
    likely, unlikely, fit = Score(1.0, 3.0, 9.0), Score(0.0, -3.0, 0.0), discovery.findings.best.fit
    why = [
        (Nomination(ONE, "needs cycles"), "needs cycles"),
        (Nomination(ONE, score=likely, tried=True, screened=fit), "a short fit gained less than others"),
        (Nomination(ONE, score=unlikely, tried=True, screened=fit), "a short fit gained less than others"),
        (
            Nomination(ONE, score=likely, tried=True),
            "could not be simulated at any strength from which a short fit starts",
        ),
        (Nomination(ONE, score=likely), "the score test predicts less gain than for others"),
        (Nomination(ONE, score=unlikely), "the score test predicts no gain in the allowed direction"),
    ]
    assert [discovery._not_fitted(nomination) for nomination, _ in why] == [words for _, words in why]


def test_a_signature_and_what_was_seen_are_sentences() -> None:
    discovery = found("unexplained")
    assert discovery._rationale(ONE) == "Expected signature: a signature. Off by 2 mV."


def test_a_state_of_charge_outside_the_window_of_the_set_is_noticed() -> None:
    assert found("effect-found").findings.best.beyond_window == {"soc": pytest.approx(1.02)}
