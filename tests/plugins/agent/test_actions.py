import json
from dataclasses import replace
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.core.messages import ALTERNATIVES
from bsa.plugins.agent.actions import Action, Offer, action_schema, check_action
from bsa_toy_cell import CAPACITY, SERIES, space
from hypothesis import given
from hypothesis import strategies as st

BASE = space().initial
OFFER = Offer(("set", "simulate", "jacobian", "predict", "look"), space(), ("cc_discharge",))


def reply(updates: object, **more: Any) -> dict[str, Any]:
    return {"analysis": "a", "hypothesis": "h", "updated_params": updates, "rationale": "r", **more}


def check(content: dict[str, Any], offer: Offer = OFFER) -> Action:
    return check_action(content, offer, BASE, [])


def test_the_schema_is_bounded_and_knows_parameters_actions_and_steps() -> None:
    schema = action_schema(OFFER)
    parts = schema["properties"]
    assert list(parts["updated_params"]["properties"]) == list(space().names)
    assert parts["action"]["enum"] == list(OFFER.kinds)
    assert parts["step"]["enum"] == ["cc_discharge"]
    assert next(iter(parts)) == "analysis"
    for name in ("analysis", "hypothesis", "rationale"):
        assert parts[name]["maxLength"] > 0
    assert json.loads(json.dumps(schema)) == schema


def test_without_reasons_the_schema_asks_for_the_action_alone() -> None:
    schema = action_schema(replace(OFFER, reasoning=False))
    assert schema["required"] == ["action"]
    assert not {"analysis", "hypothesis", "rationale"} & set(schema["properties"])


def test_each_action_has_a_schema_that_asks_for_what_it_needs() -> None:
    own = {one["properties"]["action"]["enum"][0]: one for one in action_schema(OFFER)[ALTERNATIVES]}
    assert list(own) == list(OFFER.kinds)
    needed = {
        kind: set(one["required"]) - {"analysis", "hypothesis", "action", "rationale"} for kind, one in own.items()
    }
    assert needed == {
        "set": {"updated_params"},
        "simulate": {"candidates"},
        "jacobian": set(),
        "predict": set(),
        "look": {"step"},
    }
    assert own["set"]["properties"]["updated_params"]["minProperties"] == 1
    assert "minProperties" not in own["predict"]["properties"]["updated_params"]
    assert "updated_params" not in own["look"]["properties"]


def test_what_is_not_offered_is_neither_in_the_schema_nor_taken() -> None:
    schema = action_schema(Offer(("set",), space()))
    assert not {"candidates", "params", "step", "simulations", "trial"} & set(schema["properties"])
    with pytest.raises(BsaError, match='"action" is "look"'):
        check(reply({}, action="look", step="cc_discharge"), Offer(("set",), space()))


def test_changes_apply_to_the_base_and_leave_the_rest() -> None:
    checked = check(reply({CAPACITY: "*1.2", SERIES: "+0.01"}))
    (candidate,) = checked.candidates
    assert candidate[CAPACITY] == pytest.approx(1.2)
    assert candidate[SERIES] == pytest.approx(0.06)
    assert {name: candidate[name] for name in BASE if name not in (CAPACITY, SERIES)} == {
        name: value for name, value in BASE.items() if name not in (CAPACITY, SERIES)
    }
    assert checked.projected == ()


def test_what_was_clipped_is_said() -> None:
    assert check(reply({CAPACITY: "*100", SERIES: "*1.1"})).projected == (CAPACITY,)


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
        check(reply(updates))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"action": "simulate"}, 'needs the list "candidates"'),
        ({"action": "simulate", "candidates": [{"x": "1"}]}, "not a searched parameter"),
        ({"action": "look", "step": "cc_dicharge"}, 'did you mean "cc_discharge"'),
        ({"action": "jacobian", "params": ["Capacity"]}, "not a searched parameter"),
        ({"action": "explode"}, '"action" is "explode"'),
    ],
)
def test_actions_that_lack_something_say_what(more: dict[str, Any], words: str) -> None:
    with pytest.raises(BsaError) as caught:
        check(reply({CAPACITY: "*1.1"}, **more))
    assert words in str(caught.value)


def test_several_candidates_are_taken_up_to_three() -> None:
    rows = [{CAPACITY: f"*1.{place}"} for place in range(1, 6)]
    assert [c[CAPACITY] for c in check(reply({}, action="simulate", candidates=rows)).candidates] == pytest.approx(
        [1.1, 1.2, 1.3]
    )


def test_a_prediction_needs_no_change_and_a_jacobian_may_name_parameters() -> None:
    assert check(reply(None, action="predict")).candidates == ()
    assert check(reply(None, action="jacobian")).parameters == ()
    assert check(reply(None, action="jacobian", params=[SERIES])).parameters == (SERIES,)


@given(st.dictionaries(st.sampled_from([*space().names, "x"]), st.one_of(st.text(max_size=8), st.floats(), st.none())))
def test_whatever_is_asked_the_candidate_stays_inside_the_bounds(updates: dict[str, object]) -> None:
    try:
        (candidate,) = check(reply(updates)).candidates
    except BsaError:
        return
    assert space().project(candidate) == candidate


def test_words_are_shortened_and_cleaned() -> None:
    checked = check({**reply({CAPACITY: "*1.1"}), "hypothesis": "\x1b]0;title\x07" + "x" * 5000})
    assert checked.hypothesis == "x" * 300
