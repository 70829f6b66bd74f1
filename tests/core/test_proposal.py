import math
from contextlib import suppress

import pytest
from bsa.core.errors import BsaError
from bsa.core.proposal import apply_change, is_change
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("change", "result"), [("*1.2", 2.4), ("+0.5", 2.5), ("-0.5", 1.5), ("3e-2", 0.03), (7, 7.0), (" *2 ", 4.0)]
)
def test_the_papers_notation(change: str | float, result: float) -> None:
    assert apply_change(2.0, change) == pytest.approx(result)


@pytest.mark.parametrize(
    "change", ["", "*", "x1.2", "*nan", "inf", "1e999", None, True, [1], "__import__('os')", "1,2", "*1.2 V"]
)
def test_what_is_not_a_change_is_refused(change: object) -> None:
    with pytest.raises(BsaError) as caught:
        apply_change(2.0, change)  # type: ignore[arg-type]
    assert caught.value.hint


@given(st.text(max_size=30))
def test_no_text_gives_anything_but_a_finite_number_or_a_bsa_error(text: str) -> None:
    with suppress(BsaError):
        assert math.isfinite(apply_change(1.0, text))


@given(st.from_regex(r"\A[*+-]?[0-9]{1,5}(\.[0-9]{0,5})?([eE][+-]?[0-9]{1,2})?\Z"))
def test_the_schema_pattern_admits_only_what_can_be_applied(text: str) -> None:
    assert is_change(text)
    assert math.isfinite(apply_change(1e-6, text))
