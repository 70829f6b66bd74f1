import pytest
from bsa.core.errors import BsaError
from bsa.core.protocol_text import read_protocol, written
from hypothesis import given
from hypothesis import strategies as st

STEPS = st.sampled_from(["Charge at 1C until 4.2 V", "Rest for 90 seconds", "Discharge at C/2 for 1 hour or until 3 V"])
CYCLES = st.lists(STEPS, min_size=1, max_size=3).map(tuple)


@given(st.lists(st.tuples(CYCLES, st.integers(1, 40)), max_size=4))
def test_a_protocol_reads_as_it_was_written(runs: list[tuple[tuple[str, ...], int]]) -> None:
    protocol = tuple(cycle for cycle, count in runs for _ in range(count))
    assert read_protocol(written(protocol)) == protocol


def test_many_equal_cycles_are_one_line_and_two_are_written_out() -> None:
    cycle = ("Charge at 1C until 4.2 V", "Discharge at 1C until 2.5 V")
    assert written((cycle,) * 200) == ["200 x [Charge at 1C until 4.2 V, Discharge at 1C until 2.5 V]"]
    assert written((cycle,) * 2) == [list(cycle)] * 2


def test_steps_with_a_comma_in_them_are_written_out() -> None:
    protocol = (("Hold at 4.2 V for 1 hour, then rest",),) * 3
    assert read_protocol(written(protocol)) == protocol


@pytest.mark.parametrize("line", ["200 x Charge at 1C", "x [Rest for 1 h]", "0 x [Rest for 1 h]", "3 x [Rest,, Rest]"])
def test_another_text_is_refused(line: str) -> None:
    with pytest.raises(BsaError, match="is not a repeated cycle"):
        read_protocol([line])


def test_a_slip_of_the_pen_costs_no_memory() -> None:
    with pytest.raises(BsaError, match="is not a repeated cycle"):
        read_protocol(["999999999 x [Rest for 1 hour]"])
