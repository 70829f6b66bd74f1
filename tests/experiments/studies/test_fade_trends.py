import numpy as np
import pytest
from bsa.experiments.studies.fade_trends import FITTED_TO, LAWS, continued, trends_of

CYCLE = np.arange(1.0, 501.0)


@pytest.mark.parametrize("law", ["square root", "both"])
def test_a_fade_by_a_law_is_continued_by_it(law: str) -> None:
    capacity = 1.1 - 0.004 * np.sqrt(CYCLE)
    whole, left = continued(CYCLE, capacity, law, 200)
    np.testing.assert_allclose(whole, capacity, rtol=1e-9)
    assert left < 1e-9


def test_a_knee_after_the_fit_is_not_seen_in_it() -> None:
    capacity = 1.0 - 1e-4 * CYCLE - 1e-3 * np.maximum(CYCLE - 400.0, 0.0)
    found = list(trends_of("knee", CYCLE, capacity))
    assert len(found) == len(FITTED_TO) * len(LAWS)
    by_line = next(one for one in found if one["law"] == "line")
    assert by_line["rms_pct"] < 1e-9
    assert by_line["off_pct"] == pytest.approx(100.0 * (0.95 / 0.85 - 1.0), rel=1e-3)
