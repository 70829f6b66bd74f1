import json

import pytest
from bsa.core.errors import BsaError
from bsa.plugins.agent.reply_schema import check_reply, reply_schema
from bsa_toy_cell import CAPACITY, SERIES, space
from hypothesis import given
from hypothesis import strategies as st

BASE = space().initial


def reply(updates: object) -> dict[str, object]:
    return {"analysis": "a", "hypothesis": "h", "updated_params": updates, "rationale": "r"}


def test_the_schema_is_flat_bounded_and_knows_the_parameters() -> None:
    schema = reply_schema(space())
    assert list(schema["properties"]["updated_params"]["properties"]) == list(space().names)
    for name in ("analysis", "hypothesis", "rationale"):
        assert schema["properties"][name]["maxLength"] > 0
    assert json.loads(json.dumps(schema)) == schema


def test_changes_apply_to_the_base_and_leave_the_rest() -> None:
    checked = check_reply(reply({CAPACITY: "*1.2", SERIES: "+0.01"}), space(), BASE)
    assert checked.candidate[CAPACITY] == pytest.approx(1.2)
    assert checked.candidate[SERIES] == pytest.approx(0.06)
    assert {name: checked.candidate[name] for name in BASE if name not in (CAPACITY, SERIES)} == {
        name: value for name, value in BASE.items() if name not in (CAPACITY, SERIES)
    }
    assert checked.projected == ()


@pytest.mark.parametrize(
    ("updates", "words"),
    [
        ({}, "is empty"),
        (None, 'no object "updated_params"'),
        ([CAPACITY], 'no object "updated_params"'),
        ({"Capacity": "*1.1"}, 'did you mean "Capacity [A.h]"'),
        ({CAPACITY: "soon"}, "'soon' is not a number"),
        ({CAPACITY: "nan"}, "every value must be finite"),
        ({CAPACITY: None}, "None is not a number"),
        ({"\x1b[31mx": "1"}, '"x" is not a searched parameter'),
    ],
)
def test_replies_that_cannot_be_used_say_why(updates: object, words: str) -> None:
    with pytest.raises(BsaError) as caught:
        check_reply(reply(updates), space(), BASE)
    assert words in str(caught.value)


@given(st.dictionaries(st.sampled_from([*space().names, "x"]), st.one_of(st.text(max_size=8), st.floats(), st.none())))
def test_whatever_is_asked_the_candidate_stays_inside_the_bounds(updates: dict[str, object]) -> None:
    try:
        checked = check_reply(reply(updates), space(), BASE)
    except BsaError:
        return
    assert space().project(checked.candidate) == checked.candidate


def test_words_are_shortened_and_cleaned() -> None:
    checked = check_reply({**reply({CAPACITY: "*1.1"}), "hypothesis": "\x1b]0;title\x07" + "x" * 5000}, space(), BASE)
    assert checked.hypothesis == "x" * 300
