"""What is kept of every simulation and round of a run."""

import pytest
from bsa.experiments.campaign.trace import Trace


@pytest.mark.parametrize(
    ("objective", "improved"),
    [([9.0, 4.0, 3.9], True), ([9.0, 4.0, 4.0], False), ([9.0, 4.0, None], False), ([None, None, 5.0], True)],
)
def test_a_search_improves_on_what_the_run_itself_had_before_it(objective: list[float | None], improved: bool) -> None:
    assert Trace(objective, "iws").improved is improved


def test_a_run_without_a_search_improves_on_nothing() -> None:
    assert not Trace([9.0, 4.0], "iw").improved
    assert not Trace().improved
