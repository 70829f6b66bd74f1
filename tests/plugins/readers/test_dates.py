"""Dates of several instruments come out in seconds since 1970; what is no date is none."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.plugins.readers.dates import seconds_of


@pytest.mark.parametrize(
    "text",
    ["2010-08-17 13:44:57", "2010-08-17T13:44:57", "8/17/2010 1:44:57 PM", "17/08/2010 13:44:57", "1282052697.0"],
)
def test_one_moment_in_many_spellings(text):
    found = seconds_of([text, "", text])
    assert found[0] == found[2] == 1282052697.0
    assert np.isnan(found[1])


def test_fractions_of_seconds_may_be_missing_in_some_cells():
    np.testing.assert_allclose(seconds_of(["2010-08-17 00:00:00", "2010-08-17 00:00:29.5"]) % 86400, [0.0, 29.5])


@pytest.mark.parametrize("texts", [[], [""], ["PAU", "CHA"], ["1", "2"], ["00:10:00"], ["1e300"], ["9999-99-99"]])
def test_what_is_no_date(texts):
    assert seconds_of(texts) is None
