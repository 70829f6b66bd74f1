"""Numbers in words."""

import pytest
from bsa.experiments.report.wording import change, share


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.942, "94 %"),
        (0.999335, "99.9 %"),
        (0.99998, "99.998 %"),
        (0.9999999, "more than 99.9999 %"),
        (1.0, "100 %"),
        (0.0, "0 %"),
        (-0.352, "−35 %"),
        (None, "–"),
    ],
)
def test_a_share_is_not_rounded_to_the_whole(value: float | None, words: str) -> None:
    assert share(value) == words


def test_a_change_is_not_rounded_to_nothing_left() -> None:
    assert change(105.63, 25.44) == "−76 %"
    assert change(1000.0, 0.66) == "−99.9 %"
