"""A difference is claimed only where it holds."""

import math

import numpy as np
import pytest
from bsa.experiments.campaign.statistics import bootstrap, by_case, compare, holm, wilcoxon
from hypothesis import given
from hypothesis import strategies as st


def rows(errors, seeds=(1,)):
    """Rows from errors by method and case."""
    return [
        {"method": method, "task": f"case-{number}", "seed": seed, "mape": value}
        for method, values in errors.items()
        for number, value in enumerate(values)
        for seed in seeds
    ]


def test_a_clear_difference_holds():
    full = np.linspace(1, 8, 8)
    (found,) = compare(rows({"full": full, "bare": 3 * full * np.linspace(0.9, 1.1, 8)}), "full", "mape")
    assert found.holds
    assert found.verdict == "larger error"
    assert (found.cases, found.worse, found.better) == (8, 8, 0)
    assert found.low < found.ratio < found.high
    assert found.ratio == pytest.approx(3, rel=0.05)
    assert found.p == pytest.approx(2 / 2**8)


def test_noise_is_no_difference():
    rng = np.random.default_rng(1)
    (found,) = compare(rows({"a": rng.lognormal(0, 1, 30), "b": rng.lognormal(0, 1, 30)}), "a", "mape")
    assert not found.holds
    assert found.verdict == "no difference shown"


def test_few_cases_show_nothing_however_clear():
    (found,) = compare(rows({"a": [1, 1, 1], "b": [9, 8, 7]}), "a", "mape")
    assert found.verdict == "too few cases (3) to tell"


def test_seeds_are_not_cases():
    """Thirty seeds of three cases are still three cases."""
    (found,) = compare(rows({"a": [1, 1, 1], "b": [9, 8, 7]}, seeds=range(30)), "a", "mape")
    assert found.cases == 3
    assert not found.holds


def test_a_missing_result_forbids_the_claim():
    full = [1.0] * 8
    (found,) = compare(rows({"full": full, "bare": [*[5.0, 6.0, 7.0, 8.0, 9.0, 5.5, 6.5], None]}), "full", "mape")
    assert (found.cases, found.missing) == (7, 1)
    assert found.ratio > 5
    assert not found.holds


def test_seeds_are_averaged_by_their_geometric_mean():
    found = by_case([{"method": "a", "task": "x", "mape": value} for value in (1.0, 100.0)], "mape")
    assert found["a"]["x"] == pytest.approx(10.0)


def test_equal_methods_compare_equal():
    (found,) = compare(rows({"a": [1.0] * 8, "b": [1.0] * 8}), "a", "mape")
    assert (found.ratio, found.low, found.high, found.p) == (1, 1, 1, 1)


def test_the_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(0)
    hits = sum(low <= 0.0 <= high for low, high in (bootstrap(rng.normal(0, 1, 20)) for _ in range(60)))
    assert hits >= 50


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_lowers_and_keeps_order(p_values):
    adjusted = holm(p_values)
    assert all(after >= before for before, after in zip(p_values, adjusted, strict=True))
    assert [adjusted[place] for place in np.argsort(p_values, kind="stable")] == sorted(adjusted)


def test_no_pairs_at_all():
    assert wilcoxon(np.array([])) == 1.0
    assert all(math.isnan(value) for value in bootstrap(np.array([])))
