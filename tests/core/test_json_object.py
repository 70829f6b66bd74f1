import pytest
from bsa.core.json_object import json_object


def test_an_object_is_read() -> None:
    assert json_object('{"a": [1, null]}') == json_object(b'{"a": [1, null]}') == {"a": [1, None]}


@pytest.mark.parametrize("text", ["", "[1]", "3", '{"a": ', "text", "[" * 100_000, b"\xff\xfe{"])
def test_what_is_no_object_is_none(text: str | bytes) -> None:
    assert json_object(text) is None
