"""Numbers, nouns and articles of messages."""

import pytest
from bsa.core.printable import counted, with_article


@pytest.mark.parametrize(("number", "words"), [(0, "0 runs"), (1, "1 run"), (2, "2 runs")])
def test_a_noun_follows_its_number(number: int, words: str) -> None:
    assert counted(number, "run") == words


@pytest.mark.parametrize(
    ("noun", "words"),
    [("int", "an int"), ("float", "a float"), ("ndarray", "an ndarray"), ("NoneType", "a NoneType"), ("x\n", "a x\\n")],
)
def test_an_article_goes_with_the_first_letter(noun: str, words: str) -> None:
    assert with_article(noun) == words
