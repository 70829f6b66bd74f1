"""What a discovery found, on the terminal."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.discovery.explanation import Estimate, Explanation
from bsa.core.discovery.findings import Findings, Gap, Nomination
from bsa.core.discovery.record_discovery import RecordDiscovery
from bsa.core.effect import Effect, EffectParameter
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import ParameterSpace
from bsa.experiments.report.discovery_lines import found_lines, untried_line

RESISTANCE = Effect("contact-resistance", "", "", (EffectParameter("size", "Ohm", 0.0, 0.0, 1.0, 0.01),), "", "")


def explanation(effects: tuple[Effect, ...], rmse_v: float, held_v: float) -> Explanation:
    fit = Refit(ParameterSpace(()), np.zeros(0), np.zeros(4), np.zeros((4, 0)), True)
    found = Explanation(effects, fit, Adequacy(0.5, 0.5, 1.0), rmse_v, held_v, np.zeros(4), np.ones(4))
    estimate = Estimate("contact_resistance", "Ohm", 0.012, (0.0107, 0.0133), 0.0, False)
    found.estimates = {effect.key: (estimate,) for effect in effects}
    return found


def discovery(verdict: str, held_v: float = 7.75e-3) -> RecordDiscovery:
    base = explanation((), 3.74e-3, held_v)
    best = base if verdict == "no-missing-effect" else explanation((RESISTANCE,), 1.0e-3, 0.98e-3)
    return RecordDiscovery(Findings(verdict, Gap(base, base, 1e-3, 1e-3), best), [], [], [], 5.0)


def test_what_was_found_has_its_value_its_interval_and_both_errors() -> None:
    assert found_lines(discovery("effect-found")) == [
        "contact-resistance: contact resistance 0.012 Ω (95 % interval 0.0107 to 0.0133 Ω)",
        "Voltage RMSE: 3.74 → 1 mV",
        "Voltage RMSE of records not fitted: 7.75 → 0.98 mV",
    ]


def test_what_was_not_named_has_no_value_and_one_error_where_there_is_one() -> None:
    assert found_lines(discovery("unexplained"))[0].startswith("Voltage RMSE: 3.74 → 1")
    assert found_lines(discovery("no-missing-effect"))[0] == "Voltage RMSE: 3.74 mV"


def test_effects_that_were_asked_for_and_not_needed_are_said_to_be_untried() -> None:
    found = discovery("no-missing-effect")
    assert untried_line(found) == ""
    asked = replace(found, restricted=True)
    assert found_lines(asked)[0] == "The effects that were asked for were not evaluated: none was needed."
    lacking = Nomination(RESISTANCE, "it needs a thermal model")
    tried = replace(asked, findings=replace(asked.findings, nominations=[lacking]))
    assert untried_line(tried) == untried_line(replace(asked, findings=discovery("unexplained").findings)) == ""


@pytest.mark.parametrize("held", [float("nan"), float("inf")])
def test_an_error_that_was_not_measured_has_no_line(held: float) -> None:
    found = discovery("no-missing-effect", held)
    assert found_lines(found) == ["Voltage RMSE: 3.74 mV"]


def test_a_value_at_its_bound_says_so() -> None:
    found = discovery("effect-found")
    best = found.findings.best
    best.estimates = {key: tuple(replace(e, at_bound=True) for e in rows) for key, rows in best.estimates.items()}
    assert found_lines(found)[0].endswith("Ω, at a bound)")
