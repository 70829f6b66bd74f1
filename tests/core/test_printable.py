"""Texts that are fit for a message."""

import pytest
from bsa.core.printable import counted, one_line, rounded, strip_control, were, with_article


def test_numbers_of_things_agree_with_their_noun_and_verb():
    assert [f"{counted(n, 'gap')} {were(n)} found" for n in (0, 1, 2)] == [
        *("0 gaps were found", "1 gap was found", "2 gaps were found")
    ]
    assert [counted(n, "glitch", "es") for n in (1, 2)] == ["1 glitch", "2 glitches"]


@pytest.mark.parametrize(
    ("noun", "words"),
    [("int", "an int"), ("float", "a float"), ("ndarray", "an ndarray"), ("NoneType", "a NoneType"), ("x\n", "a x\\n")],
)
def test_an_article_goes_with_the_first_letter(noun: str, words: str) -> None:
    assert with_article(noun) == words


@pytest.mark.parametrize(
    ("value", "digits", "words"),
    [(520.0, 2, "520"), (5.0e3, 1, "5,000"), (7403110.0, 6, "7,403,110"), (0.0325, 2, "0.033"), (-22.0, 1, "-20")],
)
def test_large_numbers_are_written_out(value: float, digits: int, words: str) -> None:
    assert rounded(value, digits) == words
    assert rounded(value, digits, sign=True) == (words if value < 0 else f"+{words}")


def test_control_codes_are_stripped() -> None:
    assert strip_control("a\x1b[31mred\x1b[0m\x1b]0;title\x07\x9b2Jb\x08\tc\r\nd\u202ee") == "ared" + "b\tc\nde"


def test_words_stand_on_one_line_and_are_cut_where_they_are_long() -> None:
    assert one_line("a\x1b[31m b\n\n c\t") == "a b c"
    assert one_line("abcdef", 6) == "abcdef"
    assert one_line("abcdefg", 6) == "abcde…"
