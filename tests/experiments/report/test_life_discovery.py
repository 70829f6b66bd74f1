"""The page of a discovery over a life."""

from dataclasses import replace
from typing import Any

import numpy as np
from bsa.core.discovery.explanation import Explanation, estimates_of
from bsa.core.discovery.findings import Findings, Gap, Nomination
from bsa.core.discovery.life_discovery import LifeDiscovery
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.drift import Drift
from bsa.core.inference.refit import Refit
from bsa.core.parameters import ParameterSpace
from bsa.experiments.report.life_discovery import render
from bsa.plugins.effects.ageing import EFFECTS

SEI, PLATING = (next(e for e in EFFECTS if e.name == name) for name in ("sei-growth", "lithium-plating"))


def explanation(effects: tuple[Any, ...], error_v: float) -> Explanation:
    space = ParameterSpace(tuple(replace(p, initial=12.0) for effect in effects for p in effect.searched))
    residual, jacobian = np.full(9, 1e3 * error_v), np.full((9, len(space)), 3.0)
    fit = Refit(space, np.zeros(len(space)), residual, jacobian, True)
    found = Explanation(effects, fit, Adequacy(0.0, 0.0, 1.0), error_v, 2 * error_v, 1e-3 * residual, np.ones(9))
    found.estimates = estimates_of(effects, fit, 1.0)
    return found


def discovery(verdict: str = "unexplained", modes: bool = True) -> LifeDiscovery:
    base, best = explanation((), 5.5e-3), explanation((SEI,), 1.2e-3)
    nominations = [Nomination(SEI), Nomination(PLATING, "no cold <charge>")]
    lithium = Drift("Loss of lithium inventory [%]", (15, 80, 200), (0.5, 2.0, 4.25), (0.1, 0.1, 0.3), 2.1, 0.2)
    drifts = (lithium, replace(lithium, name="Contact resistance [Ohm]")) if modes else ()
    findings = Findings(verdict, Gap(base, base, 1e-3, 1e-3), best, [], [best], nominations, "why")
    return LifeDiscovery(
        findings, drifts, 120, {"Negative particle radius [m]": 5e-6}, notes=["a note"], simulations=77
    )


def test_the_page_has_verdict_mechanisms_and_modes() -> None:
    page = render(discovery())
    for text in ("verdict: unexplained", "77 simulations", "no cold &lt;charge&gt;", "a note", "a partial explanation"):
        assert text in page, text
    assert "Contact resistance [Ohm]" in page
    assert "4.25" in page or "4.3" in page
    assert "<svg" in page
    assert '<th>Negative particle radius</th><td class="n">5 µm</td>' in page


def test_a_strength_stands_with_its_unit() -> None:
    found = discovery("effect-found")
    content = found.to_json()
    (parameter,) = content["effects"][0]["parameters"]
    assert (parameter["value"], parameter["physical"]["unit"]) == (12.0, "A.m-2")
    np.testing.assert_allclose(parameter["physical"]["value"], 12.0 * 1.5e-7)
    assert render(found).count("A m⁻²") == 2  # with the effect, and among all that was considered


def test_a_candidate_that_was_not_fitted_has_no_numbers() -> None:
    content = discovery().to_json()
    row = next(row for row in content["candidates"] if row["name"] == "lithium-plating")
    assert (row["error"], row["delta_bic"], row["rejected"]) == (None, None, "no cold <charge>")
    assert content["base_parameters"]["Negative particle radius [m]"] == 5e-6


def test_without_a_window_there_is_no_figure() -> None:
    assert "<svg" not in render(discovery(modes=False))


def test_the_headline_counts_the_mechanisms_that_were_tried() -> None:
    found = discovery()
    for tried, words in (
        (("sei-growth", "lithium-plating"), "None of the 2 mechanisms that were tried explains how the cell ages"),
        (("sei-growth",), "The one mechanism that was tried does not explain how the cell ages"),
        ((), "No mechanism could be tried that would explain how the cell ages"),
    ):
        found.tried = tried
        assert f"<h1>{words}</h1>" in render(found)
    assert "catalogue" not in render(found)


def test_what_speaks_against_a_mechanism_is_told_in_words_of_a_life() -> None:
    found = discovery()
    found.findings.best = replace(explanation((SEI,), 5.5e-3))
    found.findings.explanations = [found.findings.best]
    row = next(row for row in found.to_json()["candidates"] if row["name"] == "sei-growth")
    assert row["rejected"] == "does not beat the cell without ageing by 10 in BIC"
