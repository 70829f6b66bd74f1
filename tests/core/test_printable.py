"""Texts that are fit for a message."""

from bsa.core.printable import counted, were


def test_numbers_of_things_agree_with_their_noun_and_verb():
    assert [f"{counted(n, 'gap')} {were(n)} found" for n in (0, 1, 2)] == [
        *("0 gaps were found", "1 gap was found", "2 gaps were found")
    ]
    assert [counted(n, "glitch", "es") for n in (1, 2)] == ["1 glitch", "2 glitches"]
