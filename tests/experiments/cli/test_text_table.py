"""Tables of text: one line a row for programs, broken to the width of a terminal."""

import pytest
from bsa.experiments.cli.text_table import print_table, print_wrapped

ROWS = [("short", "one two three four five six seven", "zz 1.0"), ("longer-name", "one\x1b[31m\ntwo", "")]


def test_rows_are_lines_of_columns_without_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("things", [("a", "long cell", "end"), ("bcd", "e\n\x1b[2Jf", "")])
    assert capsys.readouterr().out == "\nthings\n  a    long cell  end\n  bcd  e f\n"
    print_table("none", [])
    assert capsys.readouterr().out == ""


def test_without_a_terminal_a_row_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    print_wrapped("things", ROWS)
    assert capsys.readouterr().out == (
        "\nthings\n  short        one two three four five six seven (zz 1.0)\n  longer-name  one two\n"
    )


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        (40, ["  short        one two three four five", "               six seven (zz 1.0)", "  longer-name  one two"]),
        (24, ["  short", "      one two three four", "      five six seven (zz", "      1.0)", "  longer-name"]),
    ],
)
def test_a_terminal_breaks_no_line(width: int, expected: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    print_wrapped("things", ROWS, width)
    lines = capsys.readouterr().out.splitlines()
    assert lines[2 : 2 + len(expected)] == expected
    assert max(map(len, lines)) <= width
