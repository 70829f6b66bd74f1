import json
import time
from contextlib import suppress

import pytest
from bsa.core.contracts.reply_parsing import MAX_REPLY_CHARS, parse_object
from bsa.core.errors import BsaError
from hypothesis import given
from hypothesis import strategies as st

KEYS = ("hypothesis", "updated_params")
PLAIN = {"hypothesis": "slow", "updated_params": {"Electrode height [m]": "*1.2"}}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(PLAIN),
        "Here you are:\n```json\n" + json.dumps(PLAIN, indent=2) + "\n```\nGood luck!",
        '<think>maybe {"hypothesis": "no", "updated_params": {}}</think>' + json.dumps(PLAIN),
        '{"hypothesis": "slow", // a guess\n "updated_params": {"Electrode height [m]": "*1.2",},}',
        '{"hypothesis": "slow", /* a guess */ "updated_params": {"Electrode height [m]": *1.2}}',
        "{'hypothesis': 'slow', 'updated_params': {'Electrode height [m]': '*1.2'}}",
        '{hypothesis: "slow"\n updated_params: {"Electrode height [m]": "*1.2"}',
        '{"hypothesis": "slow", "updated_params": {"Electrode height [m]": "*1.2"',
        '{"hypothesis": "old"} and better ' + json.dumps(PLAIN),
        json.dumps(PLAIN) + ' {"note": "that was all"}',
        "{ is a brace } " + json.dumps(PLAIN),
    ],
)
def test_repairs_what_is_plainly_meant(text: str) -> None:
    assert parse_object(text, KEYS) == PLAIN


def test_the_last_of_equal_objects_is_taken() -> None:
    assert parse_object('{"hypothesis": "a"} {"hypothesis": "b"}', KEYS) == {"hypothesis": "b"}


def test_quotes_and_newlines_inside_strings_survive() -> None:
    assert parse_object('{"a": "the "fast" rate\nfell", "b": 1,}') == {"a": 'the "fast" rate\nfell', "b": 1}


def test_types_are_left_to_the_caller() -> None:
    assert parse_object('{"a": "1.5", "b": 1.5, "c": null, "d": [1, {"e": true}]}') == {
        "a": "1.5",
        "b": 1.5,
        "c": None,
        "d": [1, {"e": True}],
    }


def test_numbers_beyond_floats_stay_text() -> None:
    assert parse_object('{"a": 1e999, "b": NaN, "c": -Infinity}') == {"a": "1e999", "b": "NaN", "c": "-Infinity"}
    assert isinstance(parse_object('{"a": ' + "9" * 5000 + "}")["a"], str)


@pytest.mark.parametrize("end", ["}", ",}"])
def test_what_a_journal_cannot_hold_is_replaced(end: str) -> None:
    assert parse_object('{"a": "\\ud800b"' + end) == {"a": "\ufffdb"}
    assert parse_object('{"a": "\\ud83d\\ude00"' + end) == {"a": "\U0001f600"}


@pytest.mark.parametrize("text", ["", "   ", "I cannot help with that.", "[1, 2]", "{}{", "{{{{", "{:}"])
def test_a_reply_without_object_is_an_error(text: str) -> None:
    if text.startswith("{}"):
        assert parse_object(text) == {}
        return
    with pytest.raises(BsaError, match="reply"):
        parse_object(text)


@pytest.mark.parametrize("depth", [20, 300, 900, 5000])
def test_deep_nesting_is_no_crash(depth: int) -> None:
    with suppress(BsaError):
        parse_object('{"a":' * depth + "1" + "}" * depth)


def test_code_is_text() -> None:
    assert parse_object('{"a": __import__("os").system("true")}')["a"].startswith("__import__")


@pytest.mark.slow
@pytest.mark.parametrize(
    "piece", ["{", "[", '{"a":', '{"a":/*', "{'", '{"a":[', '{"a":"', "{a ", '{"a" {', "<think>", '{"', "\\"]
)
def test_hostile_text_costs_little(piece: str) -> None:
    text = (piece * MAX_REPLY_CHARS)[:MAX_REPLY_CHARS]
    began = time.perf_counter()
    with suppress(BsaError):
        parse_object(text, KEYS)
    assert time.perf_counter() - began < 5.0


def test_overlong_replies_are_refused() -> None:
    with pytest.raises(BsaError, match="characters"):
        parse_object("x" * 20_000_000)


@given(st.text(alphabet="{}[]\",:'\\/*# \nabc1.-e", max_size=200))
def test_any_text_gives_an_object_or_a_bsa_error(text: str) -> None:
    with suppress(BsaError):
        assert isinstance(parse_object(text), dict)


SHORT = st.text(max_size=12)


@pytest.mark.slow
@given(st.dictionaries(SHORT, st.recursive(st.none() | st.booleans() | st.integers() | SHORT, st.lists, max_leaves=8)))
def test_valid_json_comes_back_as_it_is(content: dict) -> None:
    assert parse_object("answer:\n" + json.dumps(content)) == content
