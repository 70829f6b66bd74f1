"""The empirical correction of what no effect explains."""

from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.discovery.closure import fit_closure
from bsa.core.inference.observations import Observations, observe


def observed(temperature_k: float | None) -> Observations:
    found = observe(toy.measured_record("a", np.random.default_rng(0), {}), 150)
    return replace(found, temperature=None if temperature_k is None else np.full(len(found), temperature_k))


def test_a_closure_describes_a_resistance() -> None:
    o = observed(None)
    closure = fit_closure([o], [-0.01 * o.current], 1.0)
    assert closure.rmse_after_mv < 0.1 * closure.rmse_before_mv
    assert "empirical" in closure.label


def test_the_temperature_counts_only_where_every_record_has_one() -> None:
    warm = replace(observed(298.15), temperature=298.15 + np.linspace(0.0, 5.0, len(observed(None))))
    assert {"T", "i T"} <= set(fit_closure([warm, warm], [-0.01 * warm.current] * 2, 1.0).terms)
    assert not {"T", "i T"} & set(fit_closure([warm, observed(None)], [-0.01 * warm.current] * 2, 1.0).terms)


@pytest.mark.parametrize("temperature_k", [None, 298.15, 298.25])
def test_what_does_not_vary_is_left_to_the_constant(temperature_k: float | None) -> None:
    steady = replace(observed(temperature_k), current=np.full(len(observed(None)), 1.0 / 3.0))
    closure = fit_closure([steady], [np.full(len(steady), 0.1)], 1.0)
    assert not {"i", "i|i|", "T", "i T"} & set(closure.terms)
    assert "i T" not in fit_closure([observed(temperature_k)], [np.full(len(steady), 0.1)], 1.0).terms
    weights = dict(zip(closure.terms, closure.coefficients, strict=True))
    # The constant bears no penalty: nothing is left for the others.
    assert weights.pop("1") == pytest.approx(100.0)
    assert np.abs(list(weights.values())) == pytest.approx(0.0, abs=1e-6)
