"""YAML of any kind is read, or refused in one line and at once."""

import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from bsa.core.errors import BsaError
from bsa.core.yaml_text import parse_yaml, read_yaml
from hypothesis import given
from hypothesis import strategies as st

LAUGHS = "a0: &a0 [lol]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 30))

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)

HOSTILE = {
    "no number": ("a: 1\nb: !!int abc", "at line 2"),
    "no truth": ("!!bool perhaps", '"perhaps" is no bool'),
    "nothing to be a number": ('!!float ""', "is no float"),
    "6,000 digits": ("a: " + "9" * 6000, "is no int"),
    "3,000 brackets": ("[" * 3000, "more than 50 levels"),
    "3,000 braces": ("{a: " * 3000, "more than 50 levels"),
    "3,000 dashes": ("- " * 3000, "more than 50 levels"),
    "billion laughs": (LAUGHS, "more than 100000 values"),
    "laughs by merging": (LAUGHS.replace("[lol]", "{x: 1}").replace("[*", "{<<: [*").replace("]\n", "]}\n"), ""),
    "an alias inside itself": ("&a [*a]", "an alias inside"),
    "an alias of nothing": ("*a", "undefined alias"),
    "a python object": ("!!python/object/apply:os.system [id]", "could not determine a constructor"),
    "bytes": ("!!binary aGFsbG8=", "could not determine a constructor"),
    "a set": ("!!set {a, b}", "could not determine a constructor"),
    "a list for a key": ("{[1, 2]: 3}", "unhashable"),
    "two documents": ("a\n---\nb", ""),
    "a control character": ("a: \x07", ""),
    "too long": ("a" * 2_000_000, "more than 1048576 characters"),
}


@pytest.mark.parametrize(("text", "words"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_text_is_refused_at_once(text: str, words: str) -> None:
    started = time.perf_counter()
    with pytest.raises(BsaError) as caught:
        parse_yaml(text, "task.yaml")
    assert time.perf_counter() - started < 10.0
    assert words in caught.value.message
    assert caught.value.message.startswith("task.yaml ")
    assert len(str(caught.value)) < 400


@given(PLAIN)
def test_plain_values_come_back(value: Any) -> None:
    assert parse_yaml(yaml.safe_dump(value), "x") == value


@given(st.text(alphabet=st.sampled_from("[]{}&*!<>|:-?,#'\"%@ \n\tab019.~=")) | st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        parse_yaml(text, "x")
    except BsaError as error:
        assert error.message.startswith("x ")  # noqa: PT017  (either is right)


@pytest.mark.parametrize("text", ["2020-01-31", "2020-13-45", "2020-01-31 10:00:00"])
def test_a_date_is_text(text: str) -> None:
    assert parse_yaml(text, "x") == text


def test_aliases_are_read() -> None:
    assert parse_yaml("a: &a {x: 1}\nb: *a\nc: {<<: *a, y: 2}", "x") == {
        "a": {"x": 1},
        "b": {"x": 1},
        "c": {"x": 1, "y": 2},
    }


def test_files(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("a: µ", encoding="utf-8")
    assert read_yaml(tmp_path / "a.yaml") == {"a": "µ"}
    (tmp_path / "latin.yaml").write_bytes("a: µ".encode("latin-1"))
    for name, words in (("gone.yaml", "does not exist"), ("", "directory"), ("latin.yaml", "cannot be read")):
        with pytest.raises(BsaError, match=words):
            read_yaml(tmp_path / name)
