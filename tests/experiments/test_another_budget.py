"""What a run that is taken up again may be given more of."""

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.another_budget import asked_anew


def test_what_is_not_given_stays_that_of_the_run() -> None:
    assert asked_anew({}, simulations=None, rounds=160) == {"rounds": 160}
    assert asked_anew({"patience": 16}, simulations=200, rounds=None) == {"patience": 16, "simulations": 200}


def test_another_setting_is_refused() -> None:
    with pytest.raises(BsaError, match=r"--set feedback\.use") as refused:
        asked_anew({"feedback.use": "overlay"})
    assert "simulations, rounds, patience can be raised" in refused.value.hint
