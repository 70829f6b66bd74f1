"""Statistics of the documentation's tables, on rows small enough to reckon by hand."""

import math

import numpy as np
import pytest
from bsa.experiments.doc_tables.layout import short, spread
from bsa.experiments.studies.table import exact_interval


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.00123, "0.0012"), (3.44, "3.4"), (12.34, "12.3"), (123.4, "123"), (math.nan, "–")],
)
def test_numbers_have_two_or_three_digits(value, text):
    assert short(value) == text


def test_a_spread_is_the_sample_standard_deviation():
    values = [1.0, 2.0, 6.0]
    assert spread(values) == f"3 ± {np.std(values, ddof=1):.2g}"
    assert spread([1.0]) == "1"
    assert spread([1.0, 3.0, math.nan]) == "2 ± 1.4 (1 without result)"


@pytest.mark.parametrize("cases", [4, 8, 55])
def test_the_exact_bound_of_no_event_is_known_in_closed_form(cases):
    upper = 100 * (1 - 0.025 ** (1 / cases))
    assert exact_interval(0, cases) == f"exact 95 % interval 0 to {upper:.2g} %"
