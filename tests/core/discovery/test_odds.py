import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.discovery.discrepancy import Discrepancy
from bsa.core.discovery.engine import Engine
from bsa.core.discovery.odds import MOST, NAMED, Odds, Weighed, weigh

CATALOGUE = (toy.QUADRATIC, toy.HYSTERESIS, toy.SLOW)


def odds_of(truth, seed=0, catalogue=CATALOGUE):
    problem, space = toy.problem(np.random.default_rng(seed), truth)
    findings = Engine(problem, space, catalogue, toy.EVIDENCE).run()
    return findings, weigh(problem, findings)


@pytest.mark.parametrize(
    ("truth", "verdict", "names"),
    [
        ({}, "no-missing-effect", ()),
        ({"sign": 0.01}, "effect-found", ("sign",)),
        ({"slow": 0.01}, "effect-found", ("slow",)),
        ({"outside": 0.01}, "unexplained", ()),
        ({"quadratic": 0.01, "sign": 0.015}, "effect-found", ("quadratic", "sign")),
    ],
)
def test_the_odds_agree_with_the_rules_where_the_answer_is_plain(truth, verdict, names):
    findings, odds = odds_of(truth)
    assert (odds.verdict, odds.names) == (findings.verdict, odds.names) == (verdict, names)
    assert sum(odds.probabilities.values()) == pytest.approx(1.0)


def test_nothing_is_named_by_the_odds_where_nothing_is_missing():
    assert [odds_of({}, seed)[1].verdict for seed in range(10)] == 10 * ["no-missing-effect"]


def weighed(*rows):
    return Odds(10, tuple(Weighed(names, Discrepancy(scale, 60.0), weight) for names, scale, weight in rows))


BASE = ((), 5e-3, 0.0)


def test_two_that_are_as_likely_are_ambiguous_and_an_ornament_is_no_rival():
    twins = weighed(BASE, (("a",), 1e-3, 50.0), (("b",), 1e-3, 49.5), (("c",), 1e-3, 20.0))
    assert (twins.verdict, twins.names, twins.rivals) == ("ambiguous", ("a",), [("b",)])
    ornament = weighed(BASE, (("a",), 1e-3, 50.0), (("a", "b"), 1e-3, 49.5))
    assert ornament.probabilities["a",] < NAMED < ornament.probability(("a",))
    assert (ornament.verdict, ornament.rivals) == ("effect-found", [])


@pytest.mark.parametrize("seed", range(20))
def test_no_probability_is_above_one(seed):
    weights = np.random.default_rng(seed).normal(200.0, 2.0, 6)
    odds = weighed(BASE, *((("a", f"{place}"), 1e-3, weight) for place, weight in enumerate(weights)))
    assert 0.99 < odds.probability(("a",)) <= 1.0


def test_what_leaves_most_of_the_discrepancy_is_not_named_however_likely():
    odds = weighed(BASE, (("a",), 1.1 * MOST * 5e-3, 500.0))
    assert (odds.verdict, odds.names) == ("unexplained", ())
    assert odds.statement(("a",)) == "no odds are stated: the likeliest explanation leaves 55% of the discrepancy"


@pytest.mark.parametrize(("ahead", "verdict"), [(1.0, "unexplained"), (10.0, "effect-found")])
def test_a_name_is_clearly_likelier_than_none(ahead, verdict):
    assert weighed(BASE, (("a",), 0.0, ahead)).verdict == verdict


def test_a_probability_is_stated_of_a_name_alone():
    odds = weighed(BASE, (("a",), 0.0, 4.0), (("b",), 0.0, 1.0))
    assert odds.statement(("a",)) == "probability 0.94 among the 10 candidates tried"
    assert odds.statement(()) == ""
    assert "above 0.99" in weighed(BASE, (("a",), 0.0, 400.0)).statement(("a",))
