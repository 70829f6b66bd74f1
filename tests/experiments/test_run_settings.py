"""Budgets as people give them."""

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.run_settings import given_budgets


def test_only_what_was_given_is_set():
    assert given_budgets(rounds=3, simulations=None) == {"rounds": 3}


@pytest.mark.parametrize("value", ["5", True])
def test_text_is_no_number_of_simulations(value):
    with pytest.raises(BsaError, match=r"simulations is .*, which is no number"):
        given_budgets(simulations=value)
