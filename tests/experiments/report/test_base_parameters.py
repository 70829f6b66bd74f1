"""What a discovery fitted of the base model itself."""

from types import SimpleNamespace

import numpy as np
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.discovery.explanation import Explanation
from bsa.core.discovery.findings import Findings, Gap
from bsa.core.discovery.record_discovery import RecordDiscovery
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import InitialSoc
from bsa.experiments.report.base_parameters import base_parameters

(RESISTANCE,) = effects_of(["contact-resistance"])
SPACE = ParameterSpace(
    (
        Parameter("Negative particle radius factor", 1.0, 0.5, 2.0, "log", deviation=0.3, prior=True),
        Parameter("Current offset: a [A]", 0.0, -0.02, 0.02, deviation=0.01, prior=True),
        Parameter("Initial SoC: a", 0.9, 0.0, 1.08, target=InitialSoc("a"), deviation=0.02),
        *RESISTANCE.searched,
    )
)
U = np.array([0.0, 0.5, 9.0, 1.0])


def found(deviation: float | None) -> RecordDiscovery:
    weighed = None if deviation is None else np.full(40, deviation)
    fit = Refit(SPACE, U, np.zeros(40), np.vstack([10.0 * np.eye(4)] * 10), True, weighed)
    best = Explanation((RESISTANCE,), fit, Adequacy(0.0, 0.0, 1.0), 1e-3, 1e-3, np.zeros(40), np.full(40, 1e-3))
    findings = Findings("effect-found", Gap(best, best, 1e-3, 1e-3), best, [], [best], [], "why")
    return RecordDiscovery(findings, [], [], [], 2.0)


def test_values_stand_with_their_intervals_and_what_was_known_before() -> None:
    problem = SimpleNamespace(systematic=lambda: np.zeros((40, 1)))
    radius, offset, charge = base_parameters(found(1e-3), problem)  # type: ignore[arg-type]
    assert (radius.name, radius.value, radius.before) == ("Negative particle radius factor", "1", "1, × or ÷ 1.35")
    assert (offset.name, offset.value, offset.before) == ("Current offset: a", "0.005 A", "0 ± 0.01")
    # Ten samples of slope 10 in a unit of 0.01 A, beside the prior: a deviation of 1 / sqrt(1001) units.
    low, high = map(float, offset.interval.split(" to "))
    np.testing.assert_allclose(high - low, 2 * 1.96 * 0.01 / np.sqrt(1001), rtol=1e-3)
    assert (radius.flags, offset.flags) == ((), ("the interval excludes the value before",))
    assert (charge.before, charge.flags) == ("none; search from 0.9", ("at a bound", "outside 0 to 1"))


def test_without_the_deviations_of_the_fit_no_interval_is_made() -> None:
    assert {row.interval for row in base_parameters(found(None))} == {"–"}
