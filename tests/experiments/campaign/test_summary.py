import math

import pytest
from bsa.experiments.campaign.summary import geometric_mean


def test_the_geometric_mean_of_errors_knows_zero_and_none() -> None:
    assert geometric_mean([1.0, 100.0]) == pytest.approx(10.0)
    assert geometric_mean([0.0]) == pytest.approx(1e-12)
    assert math.isnan(geometric_mean([]))
